"""ArUco boards and single markers: numbered as OpenCV's GridBoard, found to a fraction of a pixel, in part as well."""

import cv2
import numpy as np
import pytest

from calibration.detection.detect import detect
from calibration.errors import DetectionError
from calibration.kinematics.stance import Stance
from calibration.problem import Problem, View
from calibration.solve import solve_hand_eye
from calibration.targets import (
    AprilTagGrid,
    ArucoGrid,
    ArucoMarker,
    Charuco,
    Chessboard,
    CircleGrid,
    Target,
    orientation_advice,
    require_markers,
)
from calibration.transforms import difference, inverse, rotation_from_vector, transform
from tests.calibration.detection.sights import CAMERA, errors_px, pictures, rms

GRID = ArucoGrid(5, 4, 24.0, 8.0, "DICT_5X5_100", 7)
MARKER = ArucoMarker(120.0, "DICT_4X4_50", 11)


@pytest.mark.slow
@pytest.mark.parametrize("target", [GRID, ArucoGrid(3, 2, 40.0, 4.0, "DICT_ARUCO_ORIGINAL"), MARKER], ids=str)
def test_corners_are_found_where_they_are(target: Target) -> None:
    errors = []
    for picture in pictures(target, 4, seed=2):
        found = detect(picture.image, target)
        assert len(found.ids) == len(target.points_mm)
        errors.append(errors_px(found, picture))
    assert rms(errors) < 0.05


def test_points_are_those_of_opencvs_board() -> None:
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    board = cv2.aruco.GridBoard((5, 4), 24.0, 8.0, dictionary, np.arange(7, 27))

    assert np.allclose(np.concatenate(board.getObjPoints()), GRID.points_mm)


def test_part_of_a_board_is_enough() -> None:
    picture = pictures(GRID, 1, seed=5)[0]
    middle = picture.pixels.mean(axis=0)
    image = picture.image.copy()
    image[:, int(middle[0]) :] = 90

    found = detect(image, GRID)

    assert 8 <= len(found.ids) < len(GRID.points_mm)
    assert np.abs(errors_px(found, picture)).max() < 0.5


@pytest.mark.parametrize(
    "described", [ArucoMarker(120.0, "DICT_4X4_50", 12), ArucoMarker(120.0, "DICT_6X6_50", 11)], ids=str
)
def test_another_marker_is_not_taken_for_this_one(described: ArucoMarker) -> None:
    with pytest.raises(DetectionError) as refusal:
        detect(pictures(MARKER, 1)[0].image, described)
    assert refusal.value.code == "not-found"


@pytest.mark.slow
@pytest.mark.parametrize("target", [GRID, pytest.param(MARKER, marks=pytest.mark.slow)], ids=str)
def test_a_session_of_markers_is_solved(target: Target) -> None:
    flange_T_camera = transform(rotation_from_vector([0.1, -0.2, 1.4]), [35.0, -20.0, 90.0])
    base_T_target = transform(rotation_from_vector([3.1, 0.1, 0.0]), [900.0, 50.0, 100.0])
    views = [
        View(
            index,
            Stance(base_T_target @ inverse(flange_T_camera @ picture.camera_T_target)),
            detect(picture.image, target),
        )
        for index, picture in enumerate(pictures(target, 12, seed=8))
    ]

    solution = solve_hand_eye(Problem("eye-in-hand", target, CAMERA, CAMERA.image_size, tuple(views)))

    assert solution.mount_T_camera is not None
    assert difference(solution.mount_T_camera, flange_T_camera)[0] < 0.3


def test_a_board_beyond_its_dictionary_is_refused() -> None:
    with pytest.raises(DetectionError, match="has 50 markers"):
        require_markers(ArucoMarker(10, "DICT_4X4_50", 50))
    with pytest.raises(DetectionError, match="is not known"):
        require_markers(ArucoGrid(2, 2, 10, 2, "DICT_3X3_50"))


@pytest.mark.parametrize(
    ("target", "ambiguous"),
    [
        (Chessboard(9, 6, 20.0), False),
        (Chessboard(9, 7, 20.0), True),
        (Chessboard(8, 6, 20.0), True),
        (Chessboard(7, 7, 20.0), True),
        (CircleGrid("symmetric", 9, 6, 20.0), True),
        (CircleGrid("symmetric", 9, 6, 20.0, origin="large-dot"), False),
        (CircleGrid("asymmetric", 4, 11, 20.0), True),
        (CircleGrid("asymmetric", 4, 10, 20.0), False),
        (Charuco(7, 5, 30.0, 22.0, "DICT_5X5_100"), False),
        (AprilTagGrid(4, 4, 30.0, 9.0), False),
        (GRID, False),
        (MARKER, False),
    ],
    ids=str,
)
def test_targets_that_look_the_same_turned_are_known(target: Target, ambiguous: bool) -> None:
    assert (orientation_advice(target) is not None) is ambiguous
