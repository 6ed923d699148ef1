"""Crossings joined into chessboard lattices.

Along an edge the colours swap from one corner to the next: the line that enters the dark at one leaves it at the
other. So two crossings are neighbours when the line between them is an edge of opposite kind at each, none is nearer,
and the relation is mutual. Joined crossings get integer coordinates, starting from the best connected one.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.detection.crossings import Crossings
from calibration.transforms import Array

NEIGHBOURS = 48
DIRECTION_TOLERANCE_RAD = 0.2

MAX_POINTS_IN_PAIRS = 1000
"""Points up to which all pairs are compared; a tree of more is quicker."""


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
    distance, other = _nearest(points, min(NEIGHBOURS, count))
    distance, other = distance[:, 1:], other[:, 1:]
    right, down = np.moveaxis(points[other] - points[:, None], -1, 0)
    cos, sin, near = np.cos(edges), np.sin(edges), np.cos(DIRECTION_TOLERANCE_RAD) * distance
    nearest = np.full((count, 4), -1)
    for kind in (0, 1):
        there = np.abs(right * cos[other, 1 - kind] + down * sin[other, 1 - kind]) > near
        along = right * cos[:, None, kind] + down * sin[:, None, kind]
        for sign, linked in enumerate((there & (along > near), there & (along < -near))):
            first = np.argmax(linked, axis=1)
            found = np.flatnonzero(linked[np.arange(count), first])
            nearest[found, kind + 2 * sign] = other[found, first[found]]
    mutual = np.full((count, 4), -1)
    for side in range(4):
        one = np.flatnonzero(nearest[:, side] >= 0)
        mutual[one, side] = np.where((nearest[nearest[one, side]] == one[:, None]).any(axis=1), nearest[one, side], -1)
    return mutual


def _nearest(points: Array, k: int) -> tuple[Array, NDArray[np.intp]]:
    """Distances (n, k) and indices (n, k) of the k nearest points of each of `points` (n, 2), itself first."""
    if len(points) > MAX_POINTS_IN_PAIRS:
        import scipy  # its import takes as long as a tree saves on dozens of pictures

        distance, index = scipy.spatial.cKDTree(points).query(points, k=k)
        return distance, index
    squares = (points[:, 0, None] - points[:, 0]) ** 2 + (points[:, 1, None] - points[:, 1]) ** 2
    index = np.argpartition(squares, k - 1, axis=1)[:, :k]
    squares = np.take_along_axis(squares, index, axis=1)
    order = np.argsort(squares, axis=1, kind="stable")
    return np.sqrt(np.take_along_axis(squares, order, axis=1)), np.take_along_axis(index, order, axis=1)


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
