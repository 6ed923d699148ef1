"""Choice of the first corner of a chessboard.

A grid of corners can be read in eight orders. The mirrored ones are impossible (the board is seen from its front), and
the order must have `columns` × `rows`. Of the others the colour decides: the square outside the first corner is black.
Where the board looks the same after half a turn (columns and rows both odd or both even) colour does not decide; then
the order is taken whose rows run most to the right in the image, and the solver, which knows the robot's motion,
corrects the views for which that was wrong.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from calibration.transforms import Array


def canonical_order(grid: Array, black_first: bool, columns: int, rows: int) -> NDArray[np.intp]:
    """Indices (rows, columns) into the flattened grid (v, u, 2) px, in the target's order.

    `black_first`: the square outside the grid's corner [0, 0] is black.
    """
    readings = []
    cells = np.arange(grid.shape[0] * grid.shape[1]).reshape(grid.shape[:2])
    flat = grid.reshape(-1, 2)
    colour_decides = (columns + rows) % 2 == 1 or (columns == rows and columns % 2 == 1)
    for reading in _readings(cells):
        if reading.shape == (rows, columns) and _turns_right(flat[reading]):
            v, u = divmod(int(reading[0, 0]), grid.shape[1])
            same_colour = (max(u - 1, 0) + max(v - 1, 0)) % 2 == 0
            if not colour_decides or black_first == same_colour:
                readings.append(reading)
    return max(readings, key=lambda reading: float((flat[reading[:, -1]] - flat[reading[:, 0]])[:, 0].sum()))


def _readings(cells: NDArray[np.intp]) -> Iterator[NDArray[np.intp]]:
    for turned in (cells, cells.T):
        for step_v in (1, -1):
            for step_u in (1, -1):
                yield turned[::step_v, ::step_u]


def _turns_right(grid: Array) -> bool:
    """x to the right and y down, as on the front of the board (image y points down)."""
    (ux, uy) = grid[-1, -1] - grid[-1, 0] + grid[0, -1] - grid[0, 0]
    (vx, vy) = grid[-1].sum(axis=0) - grid[0].sum(axis=0)
    return bool(ux * vy - uy * vx > 0)
