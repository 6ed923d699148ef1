"""ChArUco boards: partly seen ones too, with OpenCV's corner numbers."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.detection.charuco import charuco_board
from calibration.detection.detect import detect
from calibration.errors import DetectionError
from calibration.targets import Charuco
from mock_robot.scene.optics import Optics
from tests.calibration.detection.sights import errors_px, pictures, rms
from tests.simulated.views import BLURRED, ORDINARY, industrial_camera, take_picture

BOARD = Charuco(9, 7, 20.0, 15.0, "DICT_5X5_100")


@pytest.mark.slow
@pytest.mark.parametrize(("optics", "bar_px"), [(ORDINARY, 0.016), (BLURRED, 0.045)])
def test_every_corner_is_found_where_it_is(optics, bar_px):
    errors = []
    for picture in pictures(BOARD, 5, optics):
        found = detect(picture.image, BOARD)
        assert len(found.ids) == 48
        errors.append(errors_px(found, picture))
    assert rms(errors) < bar_px
    assert np.abs(np.concatenate(errors).mean(axis=0)).max() < bar_px / 4, "no bias"


@pytest.mark.parametrize(
    "board",
    [
        Charuco(5, 7, 36.0, 18.0, "DICT_6X6_250"),
        Charuco(8, 6, 20.0, 15.0, "DICT_4X4_50", legacy=True),
        Charuco(6, 5, 20.0, 17.0, "DICT_5X5_100"),
    ],
)
def test_other_dictionaries_patterns_and_marker_sizes(board):
    for picture in pictures(board, 2, tilt_deg=55.0):
        found = detect(picture.image, board)
        assert len(found.ids) == len(board.points_mm)
        assert rms([errors_px(found, picture)]) < 0.03


def test_the_points_are_opencvs():
    opencvs = np.asarray(charuco_board(BOARD).getChessboardCorners())
    assert np.allclose(opencvs[:, :2], BOARD.points_mm[:, :2])


def test_half_a_board_gives_the_corners_in_view():
    picture = pictures(BOARD, 1)[0]
    middle = int(picture.pixels[:, 0].mean())
    found = detect(np.ascontiguousarray(picture.image[:, :middle]), BOARD)
    assert 10 <= len(found.ids) < 40
    assert rms([errors_px(found, picture)]) < 0.02


def test_glare_over_some_corners_does_not_spoil_the_others():
    picture = pictures(BOARD, 1)[0]
    v, u = np.mgrid[:1200, :1600]
    spot = 400 * np.exp(-((u - picture.pixels[20, 0]) ** 2 + (v - picture.pixels[20, 1]) ** 2) / (2 * 60.0**2))
    found = detect(np.clip(picture.image + spot, 0, 255).astype(np.uint8), BOARD)
    assert len(found.ids) >= 30
    assert np.abs(errors_px(found, picture)).max() < 0.4


@pytest.mark.parametrize(
    ("configured", "code"),
    [
        (Charuco(9, 7, 20.0, 15.0, "DICT_4X4_100"), "not-found"),
        (Charuco(8, 7, 20.0, 15.0, "DICT_5X5_100"), "not-found"),
        (Charuco(7, 9, 20.0, 15.0, "DICT_5X5_100"), "not-found"),
        (Charuco(9, 7, 20.0, 15.0, "DICT_NONE"), "unknown-dictionary"),
        (Charuco(9, 7, 20.0, 15.0, "getPredefinedDictionary"), "unknown-dictionary"),
        (Charuco(90, 70, 20.0, 15.0, "DICT_4X4_50"), "dictionary-too-small"),
    ],
)
def test_another_board_than_configured_is_refused(configured, code):
    with pytest.raises(DetectionError) as refusal:
        detect(pictures(BOARD, 1)[0].image, configured)
    assert refusal.value.code == code


def test_opencv_keeps_its_warnings_to_itself(capfd):
    wide_markers = Charuco(6, 5, 20.0, 17.0, "DICT_5X5_100")
    picture = pictures(wide_markers, 1)[0]
    capfd.readouterr()
    assert len(detect(picture.image, wide_markers).ids) == 20
    assert capfd.readouterr().err == ""


LARGE, SMALL_CAMERA = Charuco(12, 9, 20.0, 15.0, "DICT_5X5_100"), industrial_camera(960, 600)


@pytest.mark.parametrize("seed", range(6))
def test_markers_of_two_dozen_pixels_aslant_and_noisy_are_read_together(seed):
    """OpenCV's detector gives no corner of half of these, and 50 to 56 of the others."""
    picture = take_picture(SMALL_CAMERA, LARGE, np.random.default_rng(seed), Optics(blur_px=1.4, read_noise=4.0), 55.0)
    found = detect(picture.image, LARGE)
    assert len(found.ids) >= 70
    assert rms([errors_px(found, picture)]) < 0.1


@pytest.mark.parametrize("other", [{"dictionary": "DICT_4X4_100"}, {"dictionary": "DICT_5X5_1000", "legacy": True}])
def test_a_board_of_other_markers_is_not_taken_for_this_one(other):
    picture = pictures(LARGE, 1)[0]
    with pytest.raises(DetectionError) as caught:
        detect(picture.image, replace(Charuco(11, 9, 20.0, 15.0, "DICT_5X5_100"), **other))
    assert caught.value.code == "not-found"
