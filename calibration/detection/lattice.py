"""Crossings joined into chessboard lattices.

Along an edge the colours swap from one corner to the next: the line that enters the dark at one leaves it at the
other. So two crossings are neighbours when the line between them is an edge of opposite kind at each, none is nearer,
and the relation is mutual. Joined crossings get integer coordinates, starting from the best connected one.
"""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from calibration.detection.crossings import Crossings
from calibration.transforms import Array

NEIGHBOURS = 48
DIRECTION_TOLERANCE_RAD = 0.2


@dataclass(frozen=True, eq=False)
class Lattice:
    """`cells` (n, 2): column and row of `points` (n, 2) in px, the least of each is 0."""

    cells: NDArray[np.intp]
    points: Array


def grow_lattices(crossings: Crossings, min_corners: int) -> list[Lattice]:
    """Lattices of at least `min_corners` corners, the largest first."""
    if len(crossings.points) < min_corners:
        return []
    neighbours = _neighbours(crossings)
    links = neighbours.tolist()
    degree = (neighbours >= 0).sum(axis=1)
    free = degree > 0
    lattices = []
    for start in np.argsort(-degree, kind="stable").tolist():
        if free[start]:
            cells = _walk(start, links)
            free[list(cells)] = False
            if len(cells) >= min_corners:
                index, cell = np.array(list(cells)), np.array(list(cells.values()))
                lattices.append(Lattice(cell - cell.min(axis=0), crossings.points[index]))
    return sorted(lattices, key=lambda lattice: -len(lattice.points))


def _neighbours(crossings: Crossings) -> NDArray[np.intp]:
    """(n, 4) the neighbour along +enter, +leave, -enter, -leave of each crossing's edges; -1 where there is none."""
    points, edges = crossings.points, np.column_stack([crossings.entering_dark, crossings.leaving_dark])
    count = len(points)
    distance, other = scipy.spatial.cKDTree(points).query(points, k=min(NEIGHBOURS, count))
    distance, other = distance[:, 1:], other[:, 1:]
    heading = np.arctan2(*np.moveaxis((points[other] - points[:, None])[..., ::-1], -1, 0))
    nearest = np.full((count, 4), -1)
    for kind in (0, 1):
        opposite_kind_there = _angle_between_lines(edges[other, 1 - kind], heading) < DIRECTION_TOLERANCE_RAD
        for sign in (0, 1):
            off = np.abs((heading - edges[:, None, kind] - sign * np.pi + np.pi) % (2 * np.pi) - np.pi)
            score = np.where((off < DIRECTION_TOLERANCE_RAD) & opposite_kind_there, distance, np.inf)
            best = np.argmin(score, axis=1)
            found = np.isfinite(score[np.arange(count), best])
            nearest[found, kind + 2 * sign] = other[found, best[found]]
    mutual = np.full((count, 4), -1)
    for side in range(4):
        one = np.flatnonzero(nearest[:, side] >= 0)
        mutual[one, side] = np.where((nearest[nearest[one, side]] == one[:, None]).any(axis=1), nearest[one, side], -1)
    return mutual


def _angle_between_lines(a: Array, b: Array) -> Array:
    return np.abs((a - b + np.pi / 2) % np.pi - np.pi / 2)


def _walk(start: int, links: list[list[int]]) -> dict[int, tuple[int, int]]:
    """Cell (column, row) of every crossing reached from `start`, breadth first; one whose cell is taken is left out."""
    cells, taken, frames = {start: (0, 0)}, {(0, 0)}, {start: 0}
    queue = [start]
    for here in queue:
        column, row = cells[here]
        for side, there in enumerate(links[here]):
            if there < 0 or there in cells:
                continue
            back = links[there].index(here)
            # `frames[i]` is which side of crossing i points along +column; sides follow each other in quarter turns
            turn = (side - frames[here]) % 4
            step = ((1, 0), (0, 1), (-1, 0), (0, -1))[turn]
            cell = (column + step[0], row + step[1])
            if cell not in taken:
                cells[there], frames[there] = cell, (back + 2 - turn) % 4
                taken.add(cell)
                queue.append(there)
    return cells
