"""What a camera or a file may deliver instead of a picture of the target: a reason each, and silence on stderr."""

import cv2
import numpy as np
import pytest

from calibration.detection.detect import detect
from calibration.errors import DetectionError
from calibration.targets import AprilTagGrid, Charuco, Chessboard, CircleGrid
from tests.calibration.detection.sights import pictures

TARGETS = [
    Chessboard(9, 6, 20.0),
    Chessboard(3, 2, 20.0),
    Charuco(9, 7, 20.0, 15.0, "DICT_5X5_100"),
    CircleGrid("symmetric", 9, 7, 20.0),
    CircleGrid("symmetric", 4, 3, 20.0, "white", "large-dot"),
    CircleGrid("asymmetric", 4, 11, 40.0),
    AprilTagGrid(4, 3, 30.0, 9.0),
]


def noise(*shape):
    return np.random.default_rng(3).integers(0, 256, shape).astype(np.uint8)


BAD = {
    "not an array": ([[1, 2], [3, 4]], "image-type"),
    "nothing": (None, "image-type"),
    "floating point with NaN": (np.full((480, 640), np.nan), "image-type"),
    "16 bit": (np.zeros((480, 640), np.uint16), "image-type"),
    "no pixels": (np.zeros((0, 0), np.uint8), "image-too-small"),
    "no rows": (np.zeros((0, 640), np.uint8), "image-too-small"),
    "four channels": (noise(480, 640, 4), "image-shape"),
    "one line": (noise(640), "image-shape"),
    "a movie": (noise(3, 480, 640, 3), "image-shape"),
    "a stamp": (noise(20, 20), "image-too-small"),
    "a strip": (noise(2, 4000), "image-too-small"),
    "lens cap": (np.zeros((480, 640), np.uint8), "image-black"),
    "overexposed": (np.full((480, 640), 255, np.uint8), "image-saturated"),
    "fog": (np.full((480, 640), 128, np.uint8), "image-flat"),
}


@pytest.mark.parametrize(("image", "code"), BAD.values(), ids=BAD)
def test_bad_images_are_refused_by_name(image, code):
    with pytest.raises(DetectionError) as refusal:
        detect(image, TARGETS[0])
    assert refusal.value.code == code
    assert refusal.value.fix


def mottled(sigma_px):
    soft = cv2.GaussianBlur(np.random.default_rng(6).normal(0, 1, (480, 640)).astype(np.float32), (0, 0), sigma_px)
    return np.clip(127 + 60 * soft / soft.std(), 0, 255).astype(np.uint8)


def worlds():
    rng = np.random.default_rng(4)
    v, u = np.mgrid[:480, :640]
    yield "noise", noise(480, 640)
    yield "colour noise", noise(480, 640, 3)
    yield "stripes", (127 + 100 * np.sign(np.sin(u / 9.0))).astype(np.uint8)
    yield "ramp", (u * 255 // 640).astype(np.uint8)
    yield "endless chessboard", (40 + 170 * (((u // 17) + (v // 17)) % 2)).astype(np.uint8)
    yield "endless dots", (220 - 180 * ((u % 20 - 10) ** 2 + (v % 20 - 10) ** 2 < 30)).astype(np.uint8)
    yield "boxes", np.kron(rng.integers(0, 256, (24, 32)), np.ones((20, 20))).astype(np.uint8)
    yield "one dot", np.where((u - 300) ** 2 + (v - 200) ** 2 < 900, 20, 200).astype(np.uint8)
    yield "one corner", (40 + 170 * ((u < 300) ^ (v < 200))).astype(np.uint8)
    yield "the least allowed", noise(32, 32)
    for sigma_px in (1.0, 2.0, 5.0):
        yield f"mottled {sigma_px:g} px", mottled(sigma_px)


@pytest.mark.parametrize("image", dict(worlds()).values(), ids=dict(worlds()))
@pytest.mark.parametrize("target", TARGETS, ids=lambda target: type(target).__name__)
def test_nothing_is_found_where_there_is_no_target(image, target, capfd):
    with pytest.raises(DetectionError) as refusal:
        detect(image, target)
    assert refusal.value.code in {"not-found", "other-board", "not-planar", "too-few-points", "origin-not-found"}
    assert capfd.readouterr().err == ""


OTHERS = [(target, other) for target in TARGETS for other in TARGETS[::2] if target != other]


@pytest.mark.parametrize(("target", "other"), OTHERS, ids=lambda target: type(target).__name__)
def test_one_target_is_not_taken_for_another(target, other):
    with pytest.raises(DetectionError):
        detect(pictures(target, 1)[0].image, other)


def test_an_edge_on_board_is_said_to_be_edge_on_or_not_found():
    board = Chessboard(9, 6, 20.0)
    picture = pictures(board, 1, tilt_deg=0.0)[0]
    squeezed = np.ascontiguousarray(picture.image[::30])
    with pytest.raises(DetectionError) as refusal:
        detect(squeezed, board)
    assert refusal.value.code in {"edge-on", "not-found"}
