"""Chessboards: found without a margin, refined to a hundredth of a pixel, never counted from a wrong corner."""

import numpy as np
import pytest

from calibration.detection.chessboard import verify_board
from calibration.detection.crossings import find_crossings
from calibration.detection.detect import detect
from calibration.detection.lattice import Lattice, grow_lattices
from calibration.errors import DetectionError
from calibration.targets import Charuco, Chessboard
from mock_robot.scene.printed_target import PrintOptions
from tests.calibration.detection.sights import errors_px, half_turned, pictures, rms
from tests.simulated.views import BLURRED, ORDINARY

BOARD = Chessboard(11, 8, 20.0)


@pytest.mark.slow
@pytest.mark.parametrize(("optics", "bar_px"), [(ORDINARY, 0.016), (BLURRED, 0.045)])
def test_every_corner_is_found_where_it_is(optics, bar_px):
    errors = []
    for picture in pictures(BOARD, 6, optics):
        found = detect(picture.image, BOARD)
        assert len(found.ids) == 88
        errors.append(errors_px(found, picture))
    assert rms(errors) < bar_px
    assert np.abs(np.concatenate(errors).mean(axis=0)).max() < bar_px / 4, "no bias"


@pytest.mark.parametrize("columns, rows", [(4, 3), (3, 4), (2, 3), (6, 9), (28, 17)])
@pytest.mark.parametrize("margin_mm", [None, 0.0])
@pytest.mark.parametrize("tilt_deg", [30.0, 65.0])
def test_boards_of_any_size_with_and_without_margin_are_found_from_their_first_corner(
    columns, rows, margin_mm, tilt_deg
):
    board = Chessboard(columns, rows, 15.0)
    for picture in pictures(board, 2, tilt_deg=tilt_deg, sheet=PrintOptions(margin_mm)):
        found = detect(picture.image, board)
        assert len(found.ids) == columns * rows
        assert np.abs(errors_px(found, picture)).max() < 0.2, "the colour of the squares tells which corner is first"


@pytest.mark.parametrize("columns, rows", [(7, 5), (6, 4), (5, 5), (4, 4)])
def test_a_board_that_looks_the_same_turned_round_is_read_with_its_rows_to_the_right(columns, rows):
    board = Chessboard(columns, rows, 20.0)
    for picture in pictures(board, 4):
        found = detect(picture.image, board)
        grid = found.corners_px.reshape(rows, columns, 2)
        right, down = grid[:, -1].mean(0) - grid[:, 0].mean(0), grid[-1].mean(0) - grid[0].mean(0)
        assert right[0] > 0
        assert right[0] * down[1] - right[1] * down[0] > 0, "never mirrored"
        if columns != rows:
            nearer = min(np.abs(errors_px(f, picture)).max() for f in (found, half_turned(found, columns * rows)))
            assert nearer < 0.2


def test_the_same_board_turned_in_the_image_keeps_its_first_corner():
    board = Chessboard(8, 5, 20.0)
    picture = pictures(board, 1)[0]
    height, width = picture.image.shape
    turned = detect(np.ascontiguousarray(picture.image[::-1, ::-1]), board)
    back = np.array([width - 1, height - 1]) - turned.corners_px
    assert np.abs(back - picture.pixels).max() < 0.2


def test_colour_images_give_what_grey_ones_give():
    picture = pictures(BOARD, 1)[0]
    colour = np.repeat(picture.image[:, :, None], 3, axis=2)
    assert np.allclose(detect(colour, BOARD).corners_px, detect(picture.image, BOARD).corners_px, atol=0.02)


def test_corners_under_a_hand_are_left_out_and_the_others_keep_their_numbers():
    picture = pictures(BOARD, 1)[0]
    image = picture.image.copy()
    u, v = picture.pixels[38].astype(int)
    image[v - 45 : v + 45, u - 45 : u + 45] = 90
    found = detect(image, BOARD)
    assert 38 not in found.ids
    assert 66 <= len(found.ids) < 88
    assert rms([errors_px(found, picture)]) < 0.02


@pytest.mark.parametrize(
    "printed, configured, code",
    [
        ((9, 6), (8, 6), "other-board"),
        ((9, 6), (8, 5), "other-board"),
        ((4, 3), (3, 3), "other-board"),
        ((11, 8), (4, 3), "other-board"),
        ((9, 6), (10, 6), "not-found"),
        ((9, 6), (9, 7), "not-found"),
    ],
)
def test_another_board_than_configured_is_refused(printed, configured, code):
    for picture in pictures(Chessboard(*printed, 20.0), 2):
        with pytest.raises(DetectionError, match=f"{configured[0]}×{configured[1]}") as refusal:
            detect(picture.image, Chessboard(*configured, 20.0))
        assert refusal.value.code == code


def test_the_refusal_names_the_board_that_was_found():
    with pytest.raises(DetectionError, match="9×6 inner corners was found"):
        detect(pictures(Chessboard(9, 6, 20.0), 1)[0].image, Chessboard(7, 6, 20.0))


@pytest.mark.parametrize("line", ["first column", "last row"])
def test_a_line_that_was_not_joined_is_looked_for(line):
    picture = pictures(BOARD, 1, tilt_deg=20.0)[0]
    lattice = grow_lattices(find_crossings(picture.image, 4.0), 80)[0]
    axis, number = (0, 0) if line == "first column" else (1, lattice.cells[:, 1].max())
    kept = lattice.cells[:, axis] != number
    cells = lattice.cells[kept] - lattice.cells[kept].min(axis=0)
    board = verify_board(picture.image, Lattice(cells, lattice.points[kept]))
    assert board.found.all()
    assert board.found.size == 88


def test_a_charuco_board_is_no_smaller_chessboard():
    picture = pictures(Charuco(9, 7, 20.0, 15.0, "DICT_5X5_100"), 1)[0]
    with pytest.raises(DetectionError):
        detect(picture.image, Chessboard(6, 5, 20.0))


def test_a_board_half_out_of_the_image_is_not_found():
    picture = pictures(BOARD, 1)[0]
    middle = int(picture.pixels[:, 0].mean())
    with pytest.raises(DetectionError) as refusal:
        detect(np.ascontiguousarray(picture.image[:, middle:]), BOARD)
    assert refusal.value.code in {"not-found", "too-few-points"}


def test_two_points_by_three_are_enough_and_fewer_are_said_to_be_too_few():
    with pytest.raises(DetectionError, match="only 4 points") as refusal:
        detect(pictures(Chessboard(2, 2, 20.0), 1)[0].image, Chessboard(2, 2, 20.0))
    assert refusal.value.code == "too-few-points"
