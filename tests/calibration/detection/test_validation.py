"""The gate alone, fed with points instead of images."""

import numpy as np
import pytest

from calibration.detection.detect import validate_detection
from calibration.errors import DetectionError
from calibration.problem import Detection
from calibration.targets import Chessboard
from calibration.transforms import map_points, rotation_from_vector, transform
from tests.calibration.detection.sights import CAMERA

BOARD = Chessboard(9, 6, 20.0)
SIZE = CAMERA.image_size


def seen(rotation=(0.3, -0.2, 0.5), distance_mm=450.0, height_mm=-40.0, noise_px=0.05):
    camera_T_target = transform(rotation_from_vector(rotation), [-60.0, height_mm, distance_mm])
    pixels = CAMERA.project(map_points(camera_T_target, BOARD.points_mm))
    return pixels + np.random.default_rng(0).normal(0, noise_px, pixels.shape)


def refusal(ids, pixels):
    with pytest.raises(DetectionError) as error:
        validate_detection(Detection(np.asarray(ids), np.asarray(pixels)), BOARD, SIZE)
    return error.value.code


ALL = np.arange(54)


def test_a_good_detection_passes_whole_through_a_distorting_lens():
    assert len(validate_detection(Detection(ALL, seen()), BOARD, SIZE).ids) == 54


def test_a_few_strays_are_left_out():
    pixels = seen()
    pixels[[7, 30]] += [3.0, -2.0]
    kept = validate_detection(Detection(ALL, pixels), BOARD, SIZE)
    assert set(ALL) - set(kept.ids) == {7, 30}


WRONG_NUMBERS = {
    "one column off": np.roll(ALL.reshape(6, 9), 1, axis=1).ravel(),
    "columns for rows": ALL.reshape(6, 9).T.ravel(),
    "shuffled": np.random.default_rng(1).permutation(54),
    "two rows swapped": ALL.reshape(6, 9)[[1, 0, 2, 3, 4, 5]].ravel(),
}


@pytest.mark.parametrize("order", WRONG_NUMBERS.values(), ids=WRONG_NUMBERS)
def test_wrong_numbers_are_no_plane(order):
    assert refusal(order, seen()) == "not-planar"


@pytest.mark.parametrize(
    ("code", "ids", "pixels"),
    [
        ("too-few-points", ALL[:5], seen()[:5]),
        ("too-few-points", ALL[:0], seen()[:0]),
        ("points-in-a-line", ALL[:9], seen()[:9]),
        ("edge-on", ALL, seen(rotation=(1.53, 0.0, 0.0), height_mm=0.0, noise_px=0.0)),
        ("too-far-away", ALL, seen(distance_mm=12000.0)),
    ],
)
def test_what_cannot_be_used_is_named(code, ids, pixels):
    assert refusal(ids, pixels) == code
