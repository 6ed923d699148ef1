"""Targets that nobody described, and other ones than described: which description fits what the image shows."""

from collections import Counter
from dataclasses import replace
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
import pytest

from calibration.detection.detect import detect
from calibration.detection.image import grey_image
from calibration.detection.recognition import find_alternative, recognise
from calibration.errors import DetectionError
from calibration.targets import AprilTagGrid, ArucoGrid, ArucoMarker, Charuco, Chessboard, CircleGrid, Target
from mock_robot.scene.printed_target import PrintOptions
from tests.calibration.detection.sights import pictures
from tests.simulated.recognisable import MIN_SHARE, is_same_print, outcome, photographs, recognisable_pictures
from tests.support.cases import seeds

CHARUCO = Charuco(7, 5, 30.0, 22.0, "DICT_5X5_100")
EVEN = Charuco(8, 6, 30.0, 22.0, "DICT_5X5_100")
CHESSBOARD = Chessboard(9, 6, 20.0)
CIRCLES = CircleGrid("asymmetric", 4, 11, 40.0)
ARUCO = ArucoGrid(4, 3, 30.0, 9.0, "DICT_5X5_100")
TAGS = AprilTagGrid(4, 3, 30.0, 9.0)

PICTURES = len(seeds(2))
"""Of each target."""

SLIPS: dict[str, tuple[Target, Target]] = {
    "rows and columns exchanged": (CHARUCO, replace(CHARUCO, columns=5, rows=7)),
    "one column more": (CHARUCO, replace(CHARUCO, columns=8)),
    "one column less": (CHARUCO, replace(CHARUCO, columns=6)),
    "exchanged and one less": (CHARUCO, replace(CHARUCO, columns=5, rows=6)),
    "inner corners counted": (EVEN, replace(EVEN, columns=7, rows=5)),
    "another dictionary": (CHARUCO, replace(CHARUCO, dictionary="DICT_4X4_100")),
    "dictionary of AprilTags": (replace(CHARUCO, dictionary="DICT_APRILTAG_36h11"), CHARUCO),
    "another dictionary, exchanged": (CHARUCO, replace(CHARUCO, columns=5, rows=7, dictionary="DICT_6X6_100")),
    "legacy board": (replace(EVEN, legacy=True), EVEN),
    "no legacy board": (EVEN, replace(EVEN, legacy=True)),
    "smaller chessboard": (replace(CHESSBOARD, columns=8), CHESSBOARD),
    "squares of a chessboard counted": (CHESSBOARD, replace(CHESSBOARD, columns=10, rows=7)),
    "larger chessboard": (replace(CHESSBOARD, rows=7), CHESSBOARD),
    "circles exchanged": (CIRCLES, replace(CIRCLES, columns=11, rows=4)),
    "symmetric circles": (CircleGrid("symmetric", 7, 6, 20.0), CircleGrid("asymmetric", 7, 6, 20.0)),
    "one row of circles less": (CIRCLES, replace(CIRCLES, rows=10)),
    "tags exchanged": (TAGS, replace(TAGS, columns=3, rows=4)),
    "ArUco board exchanged": (ARUCO, replace(ARUCO, columns=3, rows=4)),
    "ArUco board of another dictionary": (ARUCO, replace(ARUCO, dictionary="DICT_6X6_100")),
    "another family": (TAGS, replace(TAGS, family="tag25h9")),
}


SLOW = {"symmetric circles"}
"""Takes about ten times as long as each of the others."""


@pytest.mark.parametrize(
    ("shown", "described"),
    [pytest.param(*slip, id=name, marks=[pytest.mark.slow] * (name in SLOW)) for name, slip in SLIPS.items()],
)
def test_the_description_that_fits_is_named(shown: Target, described: Target) -> None:
    for picture in pictures(shown, PICTURES, seed=3):
        with pytest.raises(DetectionError) as refusal:
            detect(picture.image, described)

        found = find_alternative(grey_image(picture.image), described)

        assert found is not None
        assert found.target == shown
        error = found.error(refusal.value)
        assert error.code == refusal.value.code
        for name, value in found.changes:
            assert f"{name} = {value}" in error.fix


@pytest.mark.parametrize("described", [CHARUCO, CHESSBOARD, CIRCLES, TAGS], ids=lambda target: target.kind)
def test_nothing_fits_an_image_without_a_target(described: Target) -> None:
    soft = cv2.GaussianBlur(np.random.default_rng(6).normal(0, 1, (600, 800)).astype(np.float32), (0, 0), 6)

    assert find_alternative(np.clip(127 + 60 * soft / soft.std(), 0, 255).astype(np.uint8), described) is None


def test_settings_are_written_as_in_the_settings_file() -> None:
    picture = pictures(replace(EVEN, legacy=True, dictionary="DICT_4X4_100"), 1, seed=3)[0]

    found = find_alternative(grey_image(picture.image), EVEN)

    assert found is not None
    assert found.changes == (("dictionary", '"DICT_4X4_100"'), ("legacy", "true"))


PRINTS: dict[str, tuple[Target, PrintOptions | None]] = {
    "ChArUco": (Charuco(11, 7, 20.0, 14.0, "DICT_6X6_250"), None),
    "ChArUco that begins with a marker": (Charuco(6, 8, 20.0, 15.0, "DICT_4X4_50", legacy=True), None),
    "chessboard": (CHESSBOARD, None),
    "dots with a large one": (
        CircleGrid("symmetric", 6, 9, 20.0, "black", "large-dot"), PrintOptions(large_dot_ratio=0.8),
    ),
    "white dots": (CircleGrid("symmetric", 9, 6, 20.0, "white"), None),
    "asymmetric dots": (CIRCLES, None),
    "AprilTags": (AprilTagGrid(5, 4, 20.0, 6.0, "tag25h9"), None),
    "ArUco markers from 7 on": (ArucoGrid(4, 3, 20.0, 7.0, "DICT_7X7_50", 7), None),
    "one marker": (ArucoMarker(60.0, "DICT_5X5_250", 17), None),
}  # fmt: skip


@pytest.mark.parametrize(("printed", "sheet"), PRINTS.values(), ids=PRINTS)
def test_a_target_that_nobody_described_is_recognised(printed: Target, sheet: PrintOptions | None) -> None:
    for picture in pictures(printed, PICTURES, seed=4, sheet=sheet):
        found = recognise(picture.image)

        assert found is not None
        assert is_same_print(found.target, printed), found.target
        assert found.doubts == ()


def test_a_board_that_leaves_the_picture_is_doubted() -> None:
    picture = pictures(CHARUCO, 1, seed=4)[0]
    corner = picture.pixels[:, 0].max()

    found = recognise(np.ascontiguousarray(picture.image[:, : int(corner) - 5]))

    assert found is None or "doubt-beyond-picture" in [doubt.id for doubt in found.doubts]
    whole = recognise(picture.image)
    assert whole is not None
    assert whole.doubts == ()


def test_a_chessboard_is_not_named_where_squares_hold_markers_too_small_to_read() -> None:
    far = pictures(Charuco(12, 9, 20.0, 12.0, "DICT_7X7_1000"), 1, seed=4, fill=0.75)[0].image
    small = np.asarray(cv2.resize(far, None, fx=0.2, fy=0.2, interpolation=cv2.INTER_AREA))

    found = recognise(small)

    assert found is None or not isinstance(found.target, Chessboard)


@pytest.mark.slow
def test_of_pictures_of_every_kind_95_percent_are_recognised_and_none_wrongly_without_a_doubt() -> None:
    """By night a fifth of `python -m benchmarks.detection.recognition`, other pictures."""
    shown = recognisable_pictures(len(seeds(40)), seed=2)
    said = Counter(outcome(image, target) for target, image in shown)

    assert said["right"] >= MIN_SHARE * (said.total() - said["not in view"]), said
    assert said["wrong"] == 0, said


@pytest.mark.data
@pytest.mark.slow
def test_the_targets_of_photographs_are_recognised(real_data: Path) -> None:
    shown = islice(photographs(real_data), 0, None, 12)
    said = Counter(outcome(image, target) for _, target, image in shown)

    assert said["right"] >= MIN_SHARE * (said.total() - said["not in view"]), said
    assert said["wrong"] == 0, said
    assert said["right"] >= 5, said
