"""Sheets are printed as OpenCV prints them."""

import cv2
import numpy as np
import pytest

from calibration.targets import AprilTagGrid, Charuco, Chessboard, CircleGrid
from calibration.transforms import Array
from mock_robot.scene.printed_target import PrintOptions, UnprintableTarget, print_target


def at_pixels(target: Charuco | AprilTagGrid, shape: tuple[int, int], pixels_a_mm: float) -> Array:
    y, x = np.indices(shape)
    return print_target(target).reflectance((x + 0.5) / pixels_a_mm, (y + 0.5) / pixels_a_mm)


@pytest.mark.parametrize(
    ("columns", "rows", "dictionary", "legacy"),
    [
        (12, 9, "DICT_5X5_100", False),
        (5, 8, "DICT_6X6_250", False),
        (5, 8, "DICT_6X6_250", True),
        (6, 7, "DICT_4X4_50", True),
        (7, 6, "DICT_ARUCO_ORIGINAL", True),
    ],
)
def test_charuco_is_what_opencv_generates(columns: int, rows: int, dictionary: str, legacy: bool) -> None:
    modules = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary)).markerSize + 2
    marker_px, border_px = 4 * modules, 8
    square_px = marker_px + 2 * border_px
    target = Charuco(columns, rows, square_px / 4, marker_px / 4, dictionary, legacy)
    board = cv2.aruco.CharucoBoard(
        (columns, rows),
        target.square_mm,
        target.marker_mm,
        cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary)),
    )
    board.setLegacyPattern(legacy)
    image = board.generateImage((columns * square_px, rows * square_px), marginSize=0, borderBits=1)

    ours = at_pixels(target, image.shape, 4.0)

    assert np.array_equal(ours, (image > 127).astype(float))


def test_an_apriltag_grid_is_what_opencv_generates() -> None:
    target = AprilTagGrid(3, 2, 20.0, 6.0)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    board = cv2.aruco.GridBoard((3, 2), 20.0, 6.0, dictionary)
    image = board.generateImage((72 * 4, 46 * 4), marginSize=0, borderBits=1)

    assert np.array_equal(at_pixels(target, image.shape, 4.0), (image > 127).astype(float))


def test_a_chessboard_begins_with_black_before_its_first_inner_corner() -> None:
    sheet = print_target(Chessboard(3, 2, 10.0))
    u, v = np.array([-5.0, 5.0, 5.0, -15.0, 35.0]), np.array([-5.0, -5.0, 5.0, -5.0, -25.0])
    assert sheet.reflectance(u, v)[:4] == pytest.approx([0.0, 1.0, 0.0, 1.0])
    assert np.isnan(sheet.reflectance(u, v)[4])


@pytest.mark.parametrize("layout", ["symmetric", "asymmetric"])
@pytest.mark.parametrize("dots", ["black", "white"])
def test_a_dot_lies_at_every_point_and_paper_between(layout: str, dots: str) -> None:
    target = CircleGrid(layout, 4, 5, 40.0, dots)  # type: ignore[arg-type]
    sheet = print_target(target)
    inside, outside = (1.0, 0.0) if dots == "white" else (0.0, 1.0)
    u, v, _ = target.points_mm.T
    radius = 0.25 * (40.0 if layout == "symmetric" else 40.0 / np.sqrt(2))
    for angle in np.linspace(0, 6, 7):
        step = np.array([np.cos(angle), np.sin(angle)])
        assert np.all(sheet.reflectance(u + 0.99 * radius * step[0], v + 0.99 * radius * step[1]) == inside)
        assert np.all(sheet.reflectance(u + 1.01 * radius * step[0], v + 1.01 * radius * step[1]) == outside)


@pytest.mark.parametrize("layout", ["symmetric", "asymmetric"])
def test_the_large_dot_is_the_first_point_and_round(layout: str) -> None:
    target = CircleGrid(layout, 4, 5, 40.0, "black", "large-dot")  # type: ignore[arg-type]
    radius = 0.5 * (40.0 if layout == "symmetric" else 40.0 / np.sqrt(2))
    angle = np.linspace(0, 2 * np.pi, 40)
    sheet = print_target(target)
    assert np.all(sheet.reflectance(0.98 * radius * np.cos(angle), 0.98 * radius * np.sin(angle)) == 0.0)
    assert np.all(sheet.reflectance(1.02 * radius * np.cos(angle), 1.02 * radius * np.sin(angle)) == 1.0)


@pytest.mark.parametrize(
    ("target", "sheet", "words"),
    [
        (Charuco(5, 5, 20.0, 15.0, "DICT_9X9"), PrintOptions(), "no marker dictionary"),
        (Charuco(5, 5, 20.0, 15.0, "__doc__"), PrintOptions(), "no marker dictionary"),
        (Charuco(20, 20, 20.0, 15.0, "DICT_4X4_50"), PrintOptions(), "50 markers"),
        (AprilTagGrid(8, 8, 20.0, 5.0, "tag16h5"), PrintOptions(), "30 markers"),
        (CircleGrid("symmetric", 4, 4, 20.0), PrintOptions(dot_ratio=1.1), "smaller dot ratio"),
    ],
)
def test_what_cannot_be_printed_is_said(
    target: Charuco | AprilTagGrid | CircleGrid, sheet: PrintOptions, words: str
) -> None:
    with pytest.raises(UnprintableTarget, match=words):
        print_target(target, sheet)
