"""Photographs and public renderings."""

import json

import cv2
import numpy as np
import pytest

from calibration.camera import CameraModel
from calibration.detection.detect import detect
from calibration.errors import DetectionError
from calibration.targets import Charuco, Chessboard, CircleGrid
from calibration.transforms import inverse, map_points, transform_from_quaternion

pytestmark = [pytest.mark.data, pytest.mark.slow]


def images(folder):
    session = json.loads((folder / "session.json").read_text())
    for view in session["views"]:
        pose = view["base_T_flange"]
        base_T_flange = transform_from_quaternion(pose["translation_mm"], pose["quaternion_wxyz"])
        yield view["image"], base_T_flange, lambda name=view["image"]: cv2.imread(str(folder / name))


def test_the_charuco_board_is_found_in_all_photographs(real_data):
    board = Charuco(5, 7, 36.195, 18.256, "DICT_6X6_250")
    counts = {name: len(detect(read(), board).ids) for name, _, read in images(real_data / "ic_charuco")}
    assert len(counts) == 16
    assert set(counts.values()) == {24}


def test_the_dots_are_found_in_all_photographs_from_the_large_one_on(real_data):
    grid = CircleGrid("symmetric", 10, 10, 25.4, "black", "large-dot")
    counts, first = [], []
    for _, base_T_flange, read in images(real_data / "ic_circles"):
        found = detect(read(), grid)
        counts.append(len(found.ids))
        view = dict(zip(found.ids.tolist(), found.corners_px, strict=True))
        along = view[9] - view[1]
        # the camera hangs on the flange and the board lies still: its rows turn in the image as the flange turns
        turn = np.arctan2(base_T_flange[1, 0], base_T_flange[0, 0])
        first.append(np.degrees(np.arctan2(along[1], along[0]) - turn))
    assert len(counts) == 15
    assert min(counts) >= 98
    assert np.ptp((np.array(first) - first[0] + 180) % 360) < 60, "all read from one corner"


def test_no_wrong_detection_on_a_small_board_without_margin(real_data):
    """251 views, 79 of which show the board's front, 8 of these from beyond 84°."""
    folder, board = real_data / "metric_1", Chessboard(4, 3, 50.0)
    truth = json.loads((folder / "truth.json").read_text())["base_T_camera"]
    camera_T_base = inverse(transform_from_quaternion(truth["translation_mm"], truth["quaternion_wxyz"]))
    given = json.loads((folder / "session.json").read_text())["camera"]
    camera = CameraModel(np.array(given["matrix"]), np.array(given["distortion"]), tuple(given["image_size"]))
    found, front = [], 0
    for number, (_, base_T_flange, read) in enumerate(images(folder)):
        expected, shows_front = _expected(camera, camera_T_base @ base_T_flange, board)
        front += shows_front
        if not shows_front and number % 8:
            continue  # most of the 172 views of the board's back: an eighth of them will do
        try:
            detection = detect(read(), board)
        except DetectionError:
            continue
        assert shows_front
        found.append(np.abs(detection.corners_px - expected[detection.ids]).max())
    assert front == 79
    assert len(found) >= 70
    assert max(found) < 1.5, "every one is right; the rest is how well the flange's board is known"


def _expected(camera, camera_T_flange, board):
    """Pixels of the corners and whether the front is seen; the board is mounted square to the flange."""
    flange_T_target = np.array([[0, 0, -1, 51.93], [-1, 0, 0, 76.24], [0, 1, 0, -60.68], [0, 0, 0, 1.0]])
    camera_T_target = camera_T_flange @ flange_T_target
    points = map_points(camera_T_target, board.points_mm)
    return camera.project(points), bool(camera_T_target[:3, 2] @ points.mean(axis=0) > 0)
