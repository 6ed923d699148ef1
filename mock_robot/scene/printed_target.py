"""Reflectance of a printed target at every plane point (u_mm, v_mm) of its frame.

Rectilinear prints (chessboard, ChArUco, AprilTags, the sheet itself) are tables of cells between lines; circles
are dots on such a sheet. Markers and their positions come from OpenCV, so the print equals that of `cv2.aruco`.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from calibration.targets import (
    AprilTagGrid,
    ArucoGrid,
    ArucoMarker,
    Charuco,
    Chessboard,
    CircleGrid,
    MarkerGrid,
    Target,
    TrackedFrame,
)
from calibration.transforms import Array

BLACK, WHITE = 0.0, 1.0


class UnprintableTarget(ValueError):
    """The target cannot be printed as described; the message says what to change."""


@dataclass(frozen=True)
class PrintOptions:
    """How a target is printed. `margin_mm` None: the margin `handeyed target` uses for its kind.

    `dot_ratio` is a dot's diameter over the distance to its nearest neighbour, `large_dot_ratio` the origin dot's.
    """

    margin_mm: float | None = None
    dot_ratio: float = 0.5
    large_dot_ratio: float = 1.0


@dataclass(frozen=True, eq=False)
class PrintedCells:
    """`values` (rows, columns), 0 black to 1 white, between the sorted lines `v_mm` and `u_mm` (one more each)."""

    u_mm: Array
    v_mm: Array
    values: Array


@dataclass(frozen=True, eq=False)
class PrintedDots:
    """`value` inside the circles of `centres_mm` (n, 2) and `radii_mm` (n,).

    They form rows of `columns` at `spacing_mm` (along u, v), odd rows shifted by `shift_mm`.
    """

    centres_mm: Array
    radii_mm: Array
    columns: int
    spacing_mm: tuple[float, float]
    shift_mm: float
    value: float

    def nearest(self, u_mm: Array, v_mm: Array) -> NDArray[np.intp]:
        """Index of the dot whose row and column band a point lies in; the large dot reaches beyond its band."""
        rows = len(self.radii_mm) // self.columns
        row = np.clip(np.rint(v_mm / self.spacing_mm[1]), 0, rows - 1).astype(np.intp)
        column = np.rint((u_mm - self.shift_mm * (row % 2)) / self.spacing_mm[0])
        dot = row * self.columns + np.clip(column, 0, self.columns - 1).astype(np.intp)
        if self.radii_mm[0] == self.radii_mm[-1]:
            return dot
        to_first = np.hypot(u_mm - self.centres_mm[0, 0], v_mm - self.centres_mm[0, 1]) - self.radii_mm[0]
        to_dot = np.hypot(u_mm - self.centres_mm[dot, 0], v_mm - self.centres_mm[dot, 1]) - self.radii_mm[dot]
        return np.where(to_first < to_dot, 0, dot)


@dataclass(frozen=True, eq=False)
class PrintedTarget:
    """Cells of a sheet and, for circle grids, its dots."""

    cells: PrintedCells
    dots: PrintedDots | None = None

    @property
    def outline_mm(self) -> Array:
        """The sheet's four corners (4, 2), in order around it."""
        (left, right), (top, bottom) = self.cells.u_mm[[0, -1]], self.cells.v_mm[[0, -1]]
        return np.array([[left, top], [right, top], [right, bottom], [left, bottom]])

    def reflectance(self, u_mm: ArrayLike, v_mm: ArrayLike) -> Array:
        """Reflectance, 0 black to 1 white, at plane points; NaN beside the sheet."""
        u, v = np.broadcast_arrays(np.asarray(u_mm, float), np.asarray(v_mm, float))
        column = np.searchsorted(self.cells.u_mm, u, "right") - 1
        row = np.searchsorted(self.cells.v_mm, v, "right") - 1
        rows, columns = self.cells.values.shape
        on_sheet = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
        value = self.cells.values[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)]
        if self.dots is not None:
            dot = self.dots.nearest(u, v)
            centre = self.dots.centres_mm[dot]
            inside = np.hypot(u - centre[..., 0], v - centre[..., 1]) < self.dots.radii_mm[dot]
            value = np.where(inside, self.dots.value, value)
        return np.where(on_sheet, value, np.nan)


@lru_cache(maxsize=16)  # a cell asks for its own with each picture
def print_target(target: Target, sheet: PrintOptions | None = None) -> PrintedTarget:
    """Build the print of a target. Raises UnprintableTarget."""
    sheet = sheet or PrintOptions()
    match target:
        case Chessboard():
            return _chessboard(target, sheet)
        case Charuco():
            return _charuco(target, sheet)
        case AprilTagGrid() | ArucoGrid() | ArucoMarker():
            return _markers(target.markers, sheet)
        case CircleGrid():
            return _circles(target, sheet)
        case TrackedFrame():
            raise UnprintableTarget("a tracked frame has no printed points: describe a board")


def _with_margin(u_mm: Array, v_mm: Array, values: Array, margin_mm: float) -> PrintedCells:
    if margin_mm <= 0:
        return PrintedCells(u_mm, v_mm, values)
    return PrintedCells(
        np.concatenate([[u_mm[0] - margin_mm], u_mm, [u_mm[-1] + margin_mm]]),
        np.concatenate([[v_mm[0] - margin_mm], v_mm, [v_mm[-1] + margin_mm]]),
        np.pad(values, 1, constant_values=WHITE),
    )


def _chessboard(target: Chessboard, sheet: PrintOptions) -> PrintedTarget:
    u = target.pitch_mm * np.arange(-1.0, target.columns + 1)
    v = target.pitch_mm * np.arange(-1.0, target.rows + 1)
    row, column = np.indices((len(v) - 1, len(u) - 1))
    margin_mm = target.pitch_mm if sheet.margin_mm is None else sheet.margin_mm
    return PrintedTarget(_with_margin(u, v, ((row + column) % 2).astype(float), margin_mm))


def _charuco(target: Charuco, sheet: PrintOptions) -> PrintedTarget:
    dictionary = _dictionary(target.dictionary)
    size = (target.columns, target.rows)
    board = cv2.aruco.CharucoBoard(size, target.square_mm, target.marker_mm, dictionary)
    board.setLegacyPattern(target.legacy)
    modules = dictionary.markerSize + 2
    border_mm = (target.square_mm - target.marker_mm) / 2
    offsets = np.concatenate([[0.0], border_mm + target.marker_mm / modules * np.arange(modules + 1)])
    u = _tile(offsets, target.columns, target.square_mm)
    v = _tile(offsets, target.rows, target.square_mm)
    values = np.full((len(v) - 1, len(u) - 1), BLACK)
    pitch = modules + 2
    for marker_id, corners in zip(np.ravel(board.getIds()), board.getObjPoints(), strict=True):
        column, row = (np.mean(corners, axis=0)[:2] // target.square_mm).astype(int)
        square = values[row * pitch : (row + 1) * pitch, column * pitch : (column + 1) * pitch]
        square[:] = WHITE
        square[1:-1, 1:-1] = _marker(dictionary, int(marker_id))
    margin_mm = target.square_mm / 2 if sheet.margin_mm is None else sheet.margin_mm
    return PrintedTarget(_with_margin(u, v, values, margin_mm))


def _markers(grid: MarkerGrid, sheet: PrintOptions) -> PrintedTarget:
    dictionary = _dictionary(grid.dictionary)
    modules = dictionary.markerSize + 2
    offsets = grid.side_mm / modules * np.arange(modules + 1)
    pitch_mm = grid.side_mm + grid.gap_mm
    u = _tile(offsets, grid.columns, pitch_mm)[:-1]
    v = _tile(offsets, grid.rows, pitch_mm)[:-1]
    values = np.full((len(v) - 1, len(u) - 1), WHITE)
    for place in range(grid.count):
        row, column = (modules + 1) * (place // grid.columns), (modules + 1) * (place % grid.columns)
        values[row : row + modules, column : column + modules] = _marker(dictionary, grid.first + place)
    margin_mm = grid.side_mm / 2 if sheet.margin_mm is None else sheet.margin_mm
    return PrintedTarget(_with_margin(u, v, values, margin_mm))


def _circles(target: CircleGrid, sheet: PrintOptions) -> PrintedTarget:
    points = target.points_mm[:, :2]
    half = target.pitch_mm / 2
    symmetric = target.layout == "symmetric"
    nearest_mm = target.pitch_mm if symmetric else half * np.sqrt(2)
    radii = np.full(len(points), sheet.dot_ratio * nearest_mm / 2)
    if target.origin == "large-dot":
        radii[0] = sheet.large_dot_ratio * nearest_mm / 2
    dot, paper = (BLACK, WHITE) if target.dots == "black" else (WHITE, BLACK)
    spacing = (target.pitch_mm, target.pitch_mm if symmetric else half)
    if radii[-1] > spacing[1] / 2 or radii[0] + radii[-1] > nearest_mm:
        raise UnprintableTarget("dots touch their neighbours: print them with a smaller dot ratio")
    dots = PrintedDots(points, radii, target.columns, spacing, 0.0 if symmetric else half, dot)
    margin_mm = nearest_mm - radii.max() if sheet.margin_mm is None else sheet.margin_mm
    low, high = points.min(axis=0) - radii.max() - margin_mm, points.max(axis=0) + radii.max() + margin_mm
    return PrintedTarget(
        PrintedCells(np.array([low[0], high[0]]), np.array([low[1], high[1]]), np.array([[paper]])), dots
    )


def _tile(offsets: Array, count: int, pitch_mm: float) -> Array:
    return np.append((pitch_mm * np.arange(count)[:, None] + offsets).ravel(), pitch_mm * count)


def _dictionary(name: str) -> Any:
    number = getattr(cv2.aruco, name, None)
    if not name.startswith("DICT_") or number is None:
        raise UnprintableTarget(f"'{name}' is no marker dictionary of OpenCV: use a name such as DICT_5X5_100")
    return cv2.aruco.getPredefinedDictionary(number)


def _marker(dictionary: Any, marker_id: int) -> Array:
    """(modules, modules) with the black border of one module."""
    if marker_id >= len(dictionary.bytesList):
        raise UnprintableTarget(f"the dictionary has {len(dictionary.bytesList)} markers, the board needs more")
    bits = cv2.aruco.generateImageMarker(dictionary, marker_id, dictionary.markerSize + 2)
    marker: Array = (bits > 127).astype(float)
    return marker
