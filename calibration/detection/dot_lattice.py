"""Dots joined into square lattices.

A dot's ellipse gives the local foreshortening: in the ellipse's metric the lattice is square, so the four nearest dots
lie at equal distances in four directions a quarter turn apart. From such a seed the lattice is followed, each step
predicted from the last. An asymmetric circle grid is a square lattice as well, turned by 45 degrees.
"""

from collections.abc import Iterator

import numpy as np
import scipy
from numpy.typing import NDArray

from calibration.detection.dots import Dots
from calibration.detection.lattice import Lattice
from calibration.transforms import Array

NEIGHBOURS = 14
MAX_AREA_RATIO = 1.8
LENGTH_TOLERANCE, RIGHT_ANGLE_TOLERANCE = 0.35, 0.35
STEP_TOLERANCE = 0.22
LARGE_DOT_AREA_RATIO = 8.0
"""Largest ratio of the areas of neighbours: the origin's dot may be larger."""
STEPS = ((1, 0), (0, 1), (-1, 0), (0, -1))


def grow_dot_lattices(dots: Dots, min_dots: int) -> Iterator[tuple[Lattice, NDArray[np.intp]]]:
    """Lattices of at least `min_dots` dots, each with the indices (n,) of its dots; right-handed in image axes."""
    if len(dots.centres) < min_dots:
        return
    tree = scipy.spatial.cKDTree(dots.centres)
    free = np.ones(len(dots.centres), bool)
    for seed, u, v in _seeds(dots, tree):
        if free[seed]:
            cells = _walk(seed, u, v, dots, tree)
            index, cell = np.array(list(cells)), np.array(list(cells.values()))
            free[index] = False
            if len(index) >= min_dots:
                yield Lattice(cell - cell.min(axis=0), dots.centres[index]), index


def _seeds(dots: Dots, tree: "scipy.spatial.cKDTree") -> Iterator[tuple[int, Array, Array]]:
    """Dots with four neighbours a quarter turn apart: index, and the steps (2,) in px along columns and rows."""
    _, others = tree.query(dots.centres, k=min(NEIGHBOURS, len(dots.centres)))
    to_metric = np.linalg.inv(np.linalg.cholesky(dots.shapes))
    for seed, near in enumerate(others):
        alike = near[1:][np.abs(np.log(dots.areas[near[1:]] / dots.areas[seed])) < np.log(MAX_AREA_RATIO)]
        steps = dots.centres[alike] - dots.centres[seed]
        metric = steps @ to_metric[seed].T
        length = np.hypot(*metric.T)
        if len(alike) < 4:
            continue
        first = int(np.argmin(length))
        along, across = metric @ metric[first] / length[first], _cross(metric[first] / length[first], metric)
        quarter = np.stack(
            [
                np.hypot(along, across - length[first]),
                np.hypot(along + length[first], across),
                np.hypot(along, across + length[first]),
            ]
        )
        nearest = quarter.argmin(axis=1)
        if np.all(quarter.min(axis=1) < max(LENGTH_TOLERANCE, RIGHT_ANGLE_TOLERANCE) * length[first]):
            yield seed, (steps[first] - steps[nearest[1]]) / 2, (steps[nearest[0]] - steps[nearest[2]]) / 2


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _walk(seed: int, u: Array, v: Array, dots: Dots, tree: "scipy.spatial.cKDTree") -> dict[int, tuple[int, int]]:
    """Cell (column, row) by index of every dot reached from the seed, breadth first; each step predicts the next."""
    if _cross(u, v) < 0:
        v = -v
    cells, at, steps = {seed: (0, 0)}, {(0, 0): seed}, {seed: (u, v)}
    queue = [seed]
    for here in queue:
        u, v = steps[here]
        reach = STEP_TOLERANCE * min(np.hypot(*u), np.hypot(*v))
        for column, row in STEPS:
            cell = (cells[here][0] + column, cells[here][1] + row)
            step = column * u + row * v
            distance, there = tree.query(dots.centres[here] + step, distance_upper_bound=reach + 0.5)
            if cell in at or not np.isfinite(distance) or there in cells:
                continue
            ratio = dots.areas[there] / dots.areas[here]
            if 1 / LARGE_DOT_AREA_RATIO < ratio < LARGE_DOT_AREA_RATIO:
                taken = (dots.centres[there] - dots.centres[here]) * (column + row)
                steps[there] = (taken, v) if column else (u, taken)
                cells[there], at[cell] = cell, there
                queue.append(there)
    return cells
