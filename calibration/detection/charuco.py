"""ChArUco boards: the chessboard's corners are found first, then identified by the markers between them.

Where too few corners join into a lattice, OpenCV's detector reads the markers one by one. From the corners found so
far the places of all others are predicted, and each is searched there.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.detection.chessboard import drop_sparse_lines, fit_lattice_plane
from calibration.detection.crossings import find_crossings
from calibration.detection.image import Grey, downscale, to_full_size
from calibration.detection.lattice import Lattice, grow_lattices
from calibration.detection.plane_view import PlaneView, fit_plane_view
from calibration.detection.saddle import refine_saddles
from calibration.detection.squares import half_window_px, narrowest_side
from calibration.errors import DetectionError
from calibration.problem import Detection
from calibration.sentences.sentence import Sentence
from calibration.targets import Charuco, require_markers
from calibration.transforms import Array

LATTICE_PIXELS, RING_RADII_PX, MIN_JOINED_CORNERS = 1.3e6, (4.0, 2.5), 9
MARKER_PIXELS = (1.5e6, np.inf)
"""Markers too small to be read in the reduced image may be readable in the full one."""
MIN_CORNERS, SUFFICIENT_SHARE = 4, 0.5
EMPTY_DETECTION = Detection(np.empty(0, np.intp), np.empty((0, 2)))
MAX_ROUNDS = 3
MAX_OFFSET_OF_SPACING = 0.25
"""Largest distance of a corner from its predicted place, in squares; covers the lens, which is not known yet."""


def detect_charuco(image: Grey, target: Charuco) -> Detection:
    """The inner corners in view, ids in OpenCV's order.

    Raises DetectionError `not-found`, `unknown-dictionary`, `dictionary-too-small`.
    """
    board = charuco_board(target)
    identified = (identify_lattice(seen, target) for seen in find_charuco_lattices(image))
    rough = next((found for found in identified if found is not None), EMPTY_DETECTION)
    if len(rough.ids) < SUFFICIENT_SHARE * len(target.points_mm):
        rough = max(rough, _detect_by_markers(image, board), key=lambda found: len(found.ids))
    if len(rough.ids) >= MIN_CORNERS:
        return _complete(image, target, rough.ids, rough.corners_px)
    described = {"columns": target.columns, "rows": target.rows, "dictionary": target.dictionary}
    raise DetectionError("not-found", Sentence("seen-no-charuco", **described), Sentence("see-charuco"))


@dataclass(frozen=True, eq=False)
class SeenLattice:
    """A lattice of corners in `small`, the image reduced by `factor`; `view` maps its cells to pixels there."""

    small: Grey
    factor: int
    lattice: Lattice
    view: PlaneView


def find_charuco_lattices(image: Grey) -> Iterator[SeenLattice]:
    """The lattices that may be a ChArUco board's corners, not identified yet."""
    small, factor = downscale(image, LATTICE_PIXELS)
    for radius_px in RING_RADII_PX:
        for grown in grow_lattices(find_crossings(small, radius_px), MIN_JOINED_CORNERS):
            lattice = drop_sparse_lines(grown)
            view = fit_lattice_plane(lattice, (small.shape[1], small.shape[0]))
            if view is not None:
                yield SeenLattice(small, factor, lattice, view)


def identify_lattice(seen: SeenLattice, target: Charuco) -> Detection | None:
    """The lattice's corners with the target's ids, at full size; None when its markers are not the target's.

    Raises DetectionError `unknown-dictionary`, `dictionary-too-small`.
    """
    bits = MarkerBits.from_board(charuco_board(target), target.square_mm)
    found = assign_ids(seen.small, target, bits, seen.lattice, seen.view)
    return None if found is None else Detection(found.ids, to_full_size(found.corners_px, seen.factor))


def _detect_by_markers(image: Grey, board: Any) -> Detection:
    detector = cv2.aruco.CharucoDetector(board)
    for pixels in MARKER_PIXELS:
        small, factor = downscale(image, pixels)
        corners, ids, _, _ = detector.detectBoard(small)
        if ids is not None and len(ids) >= MIN_CORNERS:
            return Detection(np.ravel(ids).astype(np.intp), to_full_size(np.reshape(corners, (-1, 2)), factor))
        if factor == 1:
            break
    return EMPTY_DETECTION


def charuco_board(target: Charuco) -> Any:
    """OpenCV's board. Raises DetectionError `unknown-dictionary`, `dictionary-too-small`."""
    require_markers(target)
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, target.dictionary))
    board = cv2.aruco.CharucoBoard((target.columns, target.rows), target.square_mm, target.marker_mm, dictionary)
    board.setLegacyPattern(target.legacy)
    return board


def _complete(image: Grey, target: Charuco, ids: NDArray[np.intp], corners: Array) -> Detection:
    """All inner corners in view: those given (ids (n,), corners (n, 2) px) and those found from them, refined."""
    found = Detection(ids, corners)
    for _ in range(MAX_ROUNDS):
        found = _search_corners(image, target, found)
        if not len(ids) < len(found.ids) < len(target.points_mm):
            break
        ids = found.ids
    return found


def _search_corners(image: Grey, target: Charuco, known: Detection) -> Detection:
    """Every corner that is a saddle close to where the plane through the `known` corners predicts it."""
    size = (image.shape[1], image.shape[0])
    points = target.points_mm[:, :2]
    view, _ = fit_plane_view(points[known.ids], known.corners_px, size)
    expected = view.map(points)
    expected[known.ids] = known.corners_px
    right, down = np.array([target.square_mm, 0.0]), np.array([0.0, target.square_mm])
    spacing = narrowest_side(view.map(points + right) - view.map(points), view.map(points + down) - view.map(points))
    to_marker = np.sqrt(0.5) * (target.square_mm - target.marker_mm) / target.square_mm
    half = half_window_px(spacing[known.ids], float(to_marker))
    inside = np.all((expected > half) & (expected < np.array(size) - 1 - half), axis=1)
    candidates = np.flatnonzero(inside)
    refined, settled = refine_saddles(image, expected[candidates], half)
    near = np.hypot(*(refined - expected[candidates]).T) < MAX_OFFSET_OF_SPACING * spacing[candidates]
    return Detection(candidates[settled & near], refined[settled & near])


# Reading a marker alone needs its outline and every bit, which fails at about a dozen pixels a marker, under noise or
# at a grazing angle. Between known corners the place of every bit is known, and only the sum over all markers has to
# agree: the lattice is identified by correlation with all markers at once.

QUARTER_TURNS = np.array([[[1, 0], [0, 1]], [[0, -1], [1, 0]], [[-1, 0], [0, -1]], [[0, 1], [-1, 0]]])
MIN_MARKERS = 3
MAX_OFFSET_OF_DIAGONAL = 0.25
"""A corner further from the lattice's plane, in half a square's diagonal, belongs to a marker, not to the board."""
MIN_CORRELATION, MIN_LEAD = 0.5, 0.25
"""Mean correlation of the markers' bits with the image (0 at a wrong place), and its lead over the next best place."""


@dataclass(frozen=True, eq=False)
class MarkerBits:
    """The markers' bits: `centres` (m, b, 2) in squares from the first inner corner; `values` (m, b), for each marker
    with mean 0 and norm 1."""

    centres: Array
    values: Array

    @classmethod
    def from_board(cls, board: Any, square_mm: float) -> "MarkerBits":
        """The bits of OpenCV's `board`, without the markers' borders."""
        dictionary, size = board.getDictionary(), board.getDictionary().markerSize
        values = [
            cv2.aruco.generateImageMarker(dictionary, int(marker), size + 2, borderBits=1)[1:-1, 1:-1]
            for marker in np.ravel(board.getIds())
        ]
        corners = np.array([corner[:, :2] for corner in board.getObjPoints()], float) / square_mm - 1.0
        step = (np.arange(size) + 1.5) / (size + 2)
        right, down = corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0]
        places = (
            corners[:, 0, None, None] + step[:, None] * right[:, None, None] + step[:, None, None] * down[:, None, None]
        )
        return cls(
            places.reshape(len(corners), -1, 2), _normalise_rows(np.array(values, float).reshape(len(corners), -1))
        )


def assign_ids(image: Grey, target: Charuco, bits: MarkerBits, lattice: Lattice, view: PlaneView) -> Detection | None:
    """The lattice's corners with the board's ids, without outliers; None when the markers do not identify them.

    `view` maps the lattice's cells to pixels.
    """
    smooth = np.asarray(cv2.GaussianBlur(image, (3, 3), 0), np.uint8)
    places = list(_alignments(lattice, target))
    agreement = [
        _mean_correlation(smooth, bits, (bits.centres - shift) @ turn, lattice, view) for turn, shift in places
    ]
    order = np.argsort(agreement)[::-1]
    best, next_best = [*(agreement[k] for k in order[:2]), 0.0, 0.0][:2]
    if best < MIN_CORRELATION or best - next_best < MIN_LEAD:
        return None
    turn, shift = places[order[0]]
    expected, beside = view.map(lattice.cells.astype(float)), view.map(lattice.cells + np.array([0.5, 0.5]))
    kept = np.hypot(*(lattice.points - expected).T) < MAX_OFFSET_OF_DIAGONAL * np.hypot(*(beside - expected).T)
    column, row = (lattice.cells[kept] @ turn.T + shift).T
    return Detection(row * (target.columns - 1) + column, lattice.points[kept])


def _alignments(lattice: Lattice, target: Charuco) -> Iterator[tuple[Array, Array]]:
    """Every rotation (2, 2) and shift (2,) that puts the lattice's cells onto the board's corners."""
    for turn in QUARTER_TURNS:
        turned = lattice.cells @ turn.T
        low, high = turned.min(axis=0), turned.max(axis=0)
        room = np.array([target.columns - 2, target.rows - 2]) - (high - low)
        for shift in product(range(room[0] + 1), range(room[1] + 1)):
            yield turn, np.array(shift) - low


def _mean_correlation(image: Grey, bits: MarkerBits, cells: Array, lattice: Lattice, view: PlaneView) -> float:
    """Mean correlation, -1 to 1, of the image with the markers on the lattice and one square around it.

    `cells` (m, b, 2): the markers' bits in the lattice's cells. 0 where fewer than MIN_MARKERS are in the image.
    """
    near = np.all((cells > -1) & (cells < lattice.cells.max(axis=0) + 1), axis=(1, 2))
    pixels = view.map(cells[near].reshape(-1, 2)).reshape(-1, *cells.shape[1:])
    inside = np.all((pixels >= 0) & (pixels <= np.array(image.shape[::-1]) - 1), axis=(1, 2))
    if inside.sum() < MIN_MARKERS:
        return 0.0
    seen = cv2.remap(image, pixels[inside].astype(np.float32), None, cv2.INTER_LINEAR)  # type: ignore[call-overload]
    return float((_normalise_rows(np.asarray(seen, float)) * bits.values[near][inside]).sum(axis=1).mean())


def _normalise_rows(rows: Array) -> Array:
    """Rows with mean 0 and norm 1; a row without contrast becomes 0."""
    centred = rows - rows.mean(axis=1, keepdims=True)
    return np.asarray(centred / np.maximum(np.linalg.norm(centred, axis=1, keepdims=True), 1.0))
