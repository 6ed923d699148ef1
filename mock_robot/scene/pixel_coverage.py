"""Coverage of a pixel's square by printed cells or dots; the pixel is a parallelogram on the sheet.

The area is exact where one straight edge crosses a pixel; where several do, the pixel is first split into 8×8 parts.
"""

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from calibration.transforms import Array
from mock_robot.scene.printed_target import PrintedCells, PrintedDots

Affine = tuple[Array, Array, Array]
"""A linear function on each pixel: its value at the centre, and its slopes along x and y per pixel."""

CELL_PARTS = 8
DOT_PARTS = 4


def share_below(level: Array, centre: Array, slope_x: Array, slope_y: Array) -> Array:
    """Share of a unit pixel where the linear function `centre + slope_x x + slope_y y` is below `level`.

    This is the distribution function of the sum of two uniform variables (a trapezoid).
    """
    a, b = np.abs(slope_x), np.abs(slope_y)
    wide = np.maximum(np.maximum(a, b), 1e-12)
    narrow = np.maximum(np.minimum(a, b), 1e-4 * wide)
    outer, inner = (wide + narrow) / 2, (wide - narrow) / 2
    s = np.clip(level - centre, -outer, outer)  # clipped, since far from the pixel the squares below would cancel

    def ramp(x: Array) -> Array:
        return np.square(np.maximum(x, 0.0))

    area = (ramp(s + outer) - ramp(s + inner) - ramp(s - inner) + ramp(s - outer)) / (2 * wide * narrow)
    clipped: Array = np.clip(area, 0.0, 1.0)
    return clipped


class LineIndex:
    """Index of the interval between sorted lines that a coordinate falls into: 0 before the first, n after the last."""

    def __init__(self, lines: Array) -> None:
        step = 0.999 * np.diff(lines).min()
        self._first, self._scale = lines[0] - step, 1.0 / step
        bins = int(np.ceil((lines[-1] - lines[0]) / step)) + 3
        starts = self._first + step * np.arange(bins)
        self._base = np.searchsorted(lines, starts, "right").astype(np.int32)
        self._next = np.append(lines, np.inf)[self._base]

    def __call__(self, coordinate: Array) -> NDArray[np.int32]:
        bins = ((coordinate - self._first) * self._scale).clip(0, len(self._base) - 1).astype(np.int32)
        index: NDArray[np.int32] = self._base[bins] + (coordinate >= self._next[bins])
        return index


class CellCoverage:
    """Coverage by cells: white and sheet share of pixels given by plane coordinates at their corners.

    `exact` False: what is at their first corners, in a tenth of the time.
    """

    def __init__(self, cells: PrintedCells, exact: bool = True) -> None:
        self._exact = exact
        self._u, self._v = cells.u_mm, cells.v_mm
        self._u_index, self._v_index = LineIndex(cells.u_mm), LineIndex(cells.v_mm)
        self._white = np.pad(cells.values, 1).astype(np.float32)
        self._sheet = np.pad(np.ones_like(cells.values), 1).astype(np.float32)

    def __call__(self, u: Array, v: Array) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """`u`, `v` (h + 1, w + 1) at pixel corners -> white and sheet shares (h, w)."""
        i, j = self._u_index(u), self._v_index(v)
        white, sheet = self._white[j[:-1, :-1], i[:-1, :-1]], self._sheet[j[:-1, :-1], i[:-1, :-1]]
        if not self._exact:
            return white, sheet
        i_low, i_high = _extremes(i)
        j_low, j_high = _extremes(j)
        y, x = np.nonzero((i_low != i_high) | (j_low != j_high))
        if len(y):
            ranges = i_low[y, x], i_high[y, x], j_low[y, x], j_high[y, x]
            white[y, x], sheet[y, x] = self._edges(_affine(u, y, x), _affine(v, y, x), ranges)
        return white, sheet

    def _edges(
        self, u: Affine, v: Affine, ranges: tuple[NDArray[np.int32], ...]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        i_low, i_high, j_low, j_high = ranges
        several = (i_high - i_low > 1) | (j_high - j_low > 1)
        several |= (i_high > i_low) & (j_high > j_low)
        white, sheet = self._blend(u, v, i_low, j_low)
        if np.any(several):
            u, v = (_parts((at[several], x[several], y[several]), CELL_PARTS) for at, x, y in (u, v))
            i = self._u_index(u[0] - (np.abs(u[1]) + np.abs(u[2])) / 2)
            j = self._v_index(v[0] - (np.abs(v[1]) + np.abs(v[2])) / 2)
            white[several], sheet[several] = (parts.mean(axis=1) for parts in self._blend(u, v, i, j))
        return white, sheet

    def _blend(
        self, u: Affine, v: Affine, i: NDArray[np.int32], j: NDArray[np.int32]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Blend the 2×2 cells from (j, i) on: exact when only one line crosses."""
        i_line, j_line = np.minimum(i, len(self._u) - 1), np.minimum(j, len(self._v) - 1)
        left = np.where(i < len(self._u), share_below(self._u[i_line], *u), 1.0)
        upper = np.where(j < len(self._v), share_below(self._v[j_line], *v), 1.0)
        i_next, j_next = np.minimum(i + 1, len(self._u)), np.minimum(j + 1, len(self._v))

        def blend(table: NDArray[np.float32], here: Any = ...) -> NDArray[np.float32]:
            x, y, x_next, y_next, west, north = (each[here] for each in (i, j, i_next, j_next, left, upper))
            top = west * table[y, x] + (1 - west) * table[y, x_next]
            bottom = west * table[y_next, x] + (1 - west) * table[y_next, x_next]
            return np.asarray(north * top + (1 - north) * bottom, np.float32)

        sheet = np.ones(i.shape, np.float32)
        rim = np.nonzero((i == 0) | (j == 0) | (i_next == len(self._u)) | (j_next == len(self._v)))
        sheet[rim] = blend(self._sheet, rim)
        return blend(self._white), sheet


def dot_coverage(dots: PrintedDots, u: Array, v: Array) -> NDArray[np.float32]:
    """Share (h, w) of each pixel inside a dot; `u`, `v` (h + 1, w + 1) at pixel corners."""
    distance = _signed_distance(dots, u, v)[0]
    low, high = _extremes(distance)
    covered = (high < 0).astype(np.float32)
    pad = 0.5 * (np.abs(np.diff(u, axis=1))[:-1] + np.abs(np.diff(v, axis=1))[:-1])
    y, x = np.nonzero((low < pad) & (high > -pad))
    if len(y):
        pu, pv = _parts(_affine(u, y, x), DOT_PARTS), _parts(_affine(v, y, x), DOT_PARTS)
        distance, nu, nv = _signed_distance(dots, pu[0], pv[0])
        shares = share_below(np.zeros(1), distance, nu * pu[1] + nv * pv[1], nu * pu[2] + nv * pv[2])
        covered[y, x] = shares.mean(axis=1)
    return covered


def _signed_distance(dots: PrintedDots, u: Array, v: Array) -> tuple[Array, Array, Array]:
    """Distance to the nearest dot's edge (inside negative) and its gradient."""
    dot = dots.nearest(u, v)
    du, dv = u - dots.centres_mm[dot, 0], v - dots.centres_mm[dot, 1]
    radius = np.maximum(np.hypot(du, dv), 1e-9)
    return radius - dots.radii_mm[dot], du / radius, dv / radius


Number = TypeVar("Number", np.int32, np.float64)


def _extremes(at_corners: NDArray[Number]) -> tuple[NDArray[Number], NDArray[Number]]:
    pair_low = np.minimum(at_corners[:, :-1], at_corners[:, 1:])
    pair_high = np.maximum(at_corners[:, :-1], at_corners[:, 1:])
    return np.minimum(pair_low[:-1], pair_low[1:]), np.maximum(pair_high[:-1], pair_high[1:])


def _affine(at_corners: Array, y: NDArray[np.intp], x: NDArray[np.intp]) -> Affine:
    a, b = at_corners[y, x], at_corners[y, x + 1]
    c, d = at_corners[y + 1, x], at_corners[y + 1, x + 1]
    return (a + b + c + d) / 4, (b - a + d - c) / 2, (c - a + d - b) / 2


def _parts(affine: Affine, count: int) -> Affine:
    """The same linear functions on each part of each pixel: centres (n, parts), slopes (n, 1)."""
    offsets = (np.arange(count) + 0.5) / count - 0.5
    dy, dx = np.meshgrid(offsets, offsets, indexing="ij")
    centre, along_x, along_y = (each[:, None] for each in affine)
    return centre + along_x * dx.ravel() + along_y * dy.ravel(), along_x / count, along_y / count
