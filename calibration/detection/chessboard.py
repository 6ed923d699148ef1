"""Chessboards: edge crossings of a reduced image joined into a lattice, corners then refined and checked at full size.

Neither a white margin nor whole outer squares are needed. A board with more corners than the target's is refused, not
cropped: the origin would be ambiguous.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.detection.crossings import find_crossings
from calibration.detection.image import Grey, downscale, to_full_size
from calibration.detection.lattice import Lattice, grow_lattices
from calibration.detection.plane_view import PlaneView, fit_plane_view
from calibration.detection.saddle import refine_saddles
from calibration.detection.squares import corner_contrast, half_window_px, narrowest_side
from calibration.errors import DetectionError
from calibration.problem import Detection
from calibration.sentences.sentence import Sentence
from calibration.targets import Chessboard
from calibration.transforms import Array

# Choice of the first corner of a chessboard.
#
# A grid of corners can be read in eight orders. The mirrored ones are impossible (the board is seen from its front),
# and the order must have `columns` × `rows`. Of the others the colour decides: the square outside the first corner is
# black. Where the board looks the same after half a turn (columns and rows both odd or both even) colour does not
# decide; then the order is taken whose rows run most to the right in the image, and the solver, which knows the
# robot's motion, corrects the views for which that was wrong.


def canonical_order(grid: Array, black_first: bool, columns: int, rows: int) -> NDArray[np.intp]:
    """Indices (rows, columns) into the flattened grid (v, u, 2) px, in the target's order.

    `black_first`: the square outside the grid's corner [0, 0] is black.
    """
    readings = []
    cells = np.arange(grid.shape[0] * grid.shape[1]).reshape(grid.shape[:2])
    flat = grid.reshape(-1, 2)
    colour_decides = (columns + rows) % 2 == 1 or (columns == rows and columns % 2 == 1)
    for reading in (turned[::v, ::u] for turned in (cells, cells.T) for v in (1, -1) for u in (1, -1)):
        if reading.shape == (rows, columns) and _turns_right(flat[reading]):
            v, u = divmod(int(reading[0, 0]), grid.shape[1])
            same_colour = (max(u - 1, 0) + max(v - 1, 0)) % 2 == 0
            if not colour_decides or black_first == same_colour:
                readings.append(reading)
    return max(readings, key=lambda reading: float((flat[reading[:, -1]] - flat[reading[:, 0]])[:, 0].sum()))


def _turns_right(grid: Array) -> bool:
    """x to the right and y down, as on the front of the board (image y points down)."""
    (ux, uy) = grid[-1, -1] - grid[-1, 0] + grid[0, -1] - grid[0, 0]
    (vx, vy) = grid[-1].sum(axis=0) - grid[0].sum(axis=0)
    return bool(ux * vy - uy * vx > 0)


SEARCHES = ((1.3e6, 4.0), (1.3e6, 2.5), (1.3e7, 4.0), (1.3e7, 2.5))
"""(pixels of the reduced image, ring radius of the crossing detector in px): tried in turn until the board is found."""
MIN_SHARE_JOINED, MIN_SHARE_OF_LINE = 0.5, 0.5
MAX_MISSING_SHARE, MAX_MISSING_SHARE_OF_FEW, FEW_CORNERS = 0.25, 0.125, 40
"""Largest share of missing corners; smaller for boards of fewer than FEW_CORNERS, since noise may form 3 by 2."""
LINES_AROUND = 2
"""Lines of corners searched around the lattice: one may have been missed, a second one reveals a larger board."""
MAX_RESIDUAL_OF_SPACING, MAX_OFFSET_OF_SPACING, MAX_OFFSET_PX = 0.25, 0.15, 0.6
MIN_CONTRAST_OF_MEDIAN = 0.35
FAR_PX = 1e6


@dataclass(frozen=True, eq=False)
class Board:
    """Part of a board: `points` (v, u, 2) in px, `found` (v, u), `black_first` as in `canonical_order`."""

    points: Array
    found: NDArray[np.bool_]
    black_first: bool


def detect_chessboard(image: Grey, target: Chessboard) -> Detection:
    """The inner corners, at most a quarter of them missing. Raises DetectionError `not-found`, `other-board`."""
    other: tuple[int, ...] | None = None
    for board in find_boards(image, target):
        if sorted(board.found.shape) == sorted((target.columns, target.rows)):
            share = MAX_MISSING_SHARE if board.found.size >= FEW_CORNERS else MAX_MISSING_SHARE_OF_FEW
            if (~board.found).sum() <= int(share * board.found.size):
                order = canonical_order(board.points, board.black_first, target.columns, target.rows).ravel()
                ids = np.flatnonzero(board.found.ravel()[order])
                return Detection(ids, board.points.reshape(-1, 2)[order[ids]])
        elif min(board.found.shape) >= 2:
            other = max(other or (0, 0), board.found.shape, key=lambda shape: shape[0] * shape[1])
    if other is not None and other[0] * other[1] >= target.columns * target.rows:
        wanted = {"wanted_columns": target.columns, "wanted_rows": target.rows}
        what = Sentence("seen-another-chessboard", columns=max(other), rows=min(other), **wanted)
        raise DetectionError("other-board", what, Sentence("see-inner-corners"))
    what = Sentence("seen-no-chessboard", columns=target.columns, rows=target.rows)
    raise DetectionError("not-found", what, Sentence("see-whole-chessboard"))


def find_boards(image: Grey, target: Chessboard) -> Iterator[Board]:
    """Every board found at each of SEARCHES, of whatever size."""
    tried = set()
    min_corners = max(4, int(MIN_SHARE_JOINED * target.columns * target.rows))
    for pixels, ring_radius_px in SEARCHES:
        small, factor = downscale(image, pixels)
        if (factor, ring_radius_px) not in tried:
            tried.add((factor, ring_radius_px))
            for lattice in grow_lattices(find_crossings(small, ring_radius_px), min_corners):
                board = verify_board(image, Lattice(lattice.cells, to_full_size(lattice.points, factor)))
                if board is not None:
                    yield board


def verify_board(image: Grey, lattice: Lattice) -> Board | None:
    """The board of a lattice: corners refined at full size, searched up to LINES_AROUND beyond it. None if not planar.

    A corner counts as found when it is a saddle near its predicted place, with the contrast and colour of the others.
    """
    lattice = drop_sparse_lines(lattice)
    view = fit_lattice_plane(lattice, (image.shape[1], image.shape[0]))
    if view is None:
        return None
    columns, rows = lattice.cells.max(axis=0) + 1 + 2 * LINES_AROUND
    v, u = np.indices((rows, columns)).reshape(2, -1)
    cells = np.column_stack([u, v]) - float(LINES_AROUND)
    # Far outside the lattice the homography and the lens's polynomial may diverge.
    around = (np.nan_to_num(view.map(cells + np.array(step)), nan=-FAR_PX) for step in ((0, 0), (0.5, 0), (0, 0.5)))
    expected, beside, below = (np.clip(points, -FAR_PX, FAR_PX) for points in around)
    along_u, along_v = 2 * (beside - expected), 2 * (below - expected)
    spacing = narrowest_side(along_u, along_v)
    joined = np.zeros((rows, columns), bool)
    joined[tuple(lattice.cells.T[::-1] + LINES_AROUND)] = True
    half = half_window_px(spacing[joined.ravel()], 1.0)
    refined, settled = refine_saddles(image, expected, half)
    contrast = corner_contrast(image, refined, along_u, along_v) * np.where((u + v) % 2 == 0, 1, -1)
    level = float(np.median(contrast[joined.ravel()]))
    found = settled & (np.hypot(*(refined - expected).T) < MAX_OFFSET_PX + MAX_OFFSET_OF_SPACING * spacing)
    found &= contrast * np.sign(level) > MIN_CONTRAST_OF_MEDIAN * abs(level)
    found &= np.all((expected > half) & (expected < np.array(image.shape[::-1]) - 1 - half), axis=1)
    points = np.where(found[:, None], refined, expected).reshape(rows, columns, 2)
    top, bottom, left, right = _trim_sparse_lines(found.reshape(rows, columns))
    block = slice(top, bottom), slice(left, right)
    return Board(points[block], found.reshape(rows, columns)[block], (level > 0) == ((top + left) % 2 == 0))


def drop_sparse_lines(lattice: Lattice) -> Lattice:
    """The lattice without outer lines that hold less than MIN_SHARE_OF_LINE of their corners."""
    columns, rows = lattice.cells.max(axis=0) + 1
    occupied = np.zeros((rows, columns), bool)
    occupied[tuple(lattice.cells.T[::-1])] = True
    top, bottom, left, right = _trim_sparse_lines(occupied)
    low, high = np.array([left, top]), np.array([right, bottom])
    kept = np.all((lattice.cells >= low) & (lattice.cells < high), axis=1)
    return Lattice(lattice.cells[kept] - low, lattice.points[kept])


def _trim_sparse_lines(occupied: NDArray[np.bool_]) -> tuple[int, int, int, int]:
    """top, bottom, left, right of the block that is left after removing sparse outer lines, the emptiest first."""
    top, bottom, left, right = 0, occupied.shape[0], 0, occupied.shape[1]
    while bottom - top > 1 and right - left > 1:
        block = occupied[top:bottom, left:right]
        share = (block[0].mean(), block[-1].mean(), block[:, 0].mean(), block[:, -1].mean())
        side = int(np.argmin(share))
        if share[side] >= MIN_SHARE_OF_LINE:
            break
        top, bottom, left, right = top + (side == 0), bottom - (side == 1), left + (side == 2), right - (side == 3)
    return top, bottom, left, right


def fit_lattice_plane(lattice: Lattice, image_size: tuple[int, int]) -> PlaneView | None:
    """The plane through most of the lattice's points; None when they lie in no plane."""
    cells, points = lattice.cells.astype(float), lattice.points
    for _ in range(3):
        if len(cells) < 4 or np.any(np.ptp(cells, axis=0) == 0):
            return None
        try:
            view, residual = fit_plane_view(cells, points, image_size)
        except DetectionError:
            return None
        spacing = np.sqrt(abs(np.linalg.det(view.jacobian(cells.mean(axis=0)))))
        near = np.hypot(*residual.T) < MAX_RESIDUAL_OF_SPACING * spacing
        if near.all():
            return view
        cells, points = cells[near], points[near]
    return None
