"""Which corner of a chessboard is the first.

A grid of corners can be read in eight ways. Mirrored ones are impossible (the board is seen from its front) and
`columns` × `rows` must come out. What is left is decided by colour: the square outside the first corner, (-1, -1), is
black. Where the board looks the same after half a turn (columns and rows both odd or both even) the reading is taken
whose rows run most to the right in the image; a solver that sees the robot move can tell when that was the other one.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from calibration.detection.image import Grey
from calibration.transforms import Array

QUARTER = 0.35
"""How far along the square's sides from its corner its colour is read: clear of blur, and of a ChArUco marker's rim."""


def canonical(grid: Array, columns: int, rows: int, image: Grey) -> Array | None:
    """The grid (rows, columns, 2) in the target's order, or None where its squares do not alternate black and white."""
    readings = []
    for reading in _readings(grid):
        if reading.shape[:2] == (rows, columns) and _turns_right(reading):
            contrast = corner_contrast(reading, image)
            if np.all(contrast > 0) or ((columns + rows) % 2 == 0 and columns != rows and np.all(contrast < 0)):
                readings.append(reading)
    if not readings:
        return None
    return max(readings, key=lambda reading: float((reading[:, -1] - reading[:, 0])[:, 0].sum()))


def _readings(grid: Array) -> Iterator[Array]:
    for turned in (grid, np.swapaxes(grid, 0, 1)):
        for step_v in (1, -1):
            for step_u in (1, -1):
                yield turned[::step_v, ::step_u]


def _turns_right(grid: Array) -> bool:
    """x to the right and y down, as on the front of the board (image y points down)."""
    (ux, uy), (vx, vy) = grid[-1, -1] - grid[-1, 0] + grid[0, -1] - grid[0, 0], grid[-1].sum(0) - grid[0].sum(0)
    return bool(ux * vy - uy * vx > 0)


def corner_contrast(grid: Array, image: Grey) -> NDArray[np.float64]:
    """White minus black (rows, columns) around every corner, positive when square (-1, -1) of the grid is black."""
    along_u, along_v = (QUARTER * np.gradient(grid, axis=axis) for axis in (1, 0))
    levels = {(a, b): _nearest(image, grid + a * along_u + b * along_v) for a in (-1, 1) for b in (-1, 1)}
    black = np.maximum(levels[1, 1], levels[-1, -1])
    white = np.minimum(levels[1, -1], levels[-1, 1])
    sign = np.where(np.indices(grid.shape[:2]).sum(axis=0) % 2 == 0, 1, -1)
    reverse = np.minimum(levels[1, 1], levels[-1, -1]) - np.maximum(levels[1, -1], levels[-1, 1])
    return np.where(
        sign > 0, np.where(white > black, white - black, -reverse), np.where(reverse > 0, reverse, black - white)
    )


def _nearest(image: Grey, points: Array) -> NDArray[np.float64]:
    column = np.clip(np.rint(points[..., 0]).astype(np.intp), 0, image.shape[1] - 1)
    row = np.clip(np.rint(points[..., 1]).astype(np.intp), 0, image.shape[0] - 1)
    return image[row, column].astype(float)
