"""The first corner does not depend on how the grid was found."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calibration.detection.chessboard import canonical_order
from calibration.targets import Chessboard
from calibration.transforms import map_points, rotation_from_vector, transform
from tests.calibration.detection.sights import CAMERA

READINGS = st.tuples(st.booleans(), st.sampled_from([1, -1]), st.sampled_from([1, -1]))


def grid_of(columns, rows, rotation):
    camera_T_target = transform(rotation_from_vector(rotation), [0.0, 0.0, 600.0])
    return CAMERA.project(map_points(camera_T_target, Chessboard(columns, rows, 10.0).points_mm)).reshape(
        rows, columns, 2
    )


def read(grid, black_first, reading):
    """The grid as found: maybe transposed, counted from another corner, with the colour outside its new first."""
    transposed, step_v, step_u = reading
    cells = np.indices(grid.shape[:2]).sum(axis=0) % 2
    numbers = np.arange(cells.size).reshape(cells.shape)
    if transposed:
        grid, numbers = np.swapaxes(grid, 0, 1), numbers.T
    rows, columns = grid.shape[:2]
    inner_row, inner_column = (0 if step_v > 0 else rows - 2), (0 if step_u > 0 else columns - 2)
    black = black_first == ((inner_row + inner_column) % 2 == 0)
    return grid[::step_v, ::step_u], black, numbers[::step_v, ::step_u]


@pytest.mark.parametrize(("columns", "rows"), [(4, 3), (3, 4), (9, 6), (2, 3)])
@settings(deadline=None)
@given(READINGS, st.floats(-np.pi, np.pi), st.floats(-0.6, 0.6))
def test_an_odd_by_even_board_has_one_first_corner(columns, rows, reading, roll, tilt):
    grid = grid_of(columns, rows, [tilt * 0.5, tilt, roll])
    found, black_first, numbers = read(grid, True, reading)
    order = canonical_order(found, black_first, columns, rows)
    assert (numbers.ravel()[order] == np.arange(columns * rows).reshape(rows, columns)).all()


@pytest.mark.parametrize(("columns", "rows"), [(5, 3), (6, 4), (5, 5), (4, 4)])
@settings(deadline=None)
@given(READINGS, st.floats(-3.0, 3.0))
def test_other_boards_are_read_alike_whatever_way_they_were_found(columns, rows, reading, roll):
    grid = grid_of(columns, rows, [0.2, -0.1, roll])
    plain, black, _ = read(grid, True, (False, 1, 1))
    found, black_first, _ = read(grid, True, reading)
    order, expected = canonical_order(found, black_first, columns, rows), canonical_order(plain, black, columns, rows)
    assert np.allclose(found.reshape(-1, 2)[order], plain.reshape(-1, 2)[expected])
