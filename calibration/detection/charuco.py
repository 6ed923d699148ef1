"""ChArUco boards: the chessboard's corners are found first, then identified by the markers between them.

Where too few corners join into a lattice, OpenCV's detector reads the markers one by one. From the corners found so
far the places of all others are predicted, and each is searched there.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.detection.charuco_lattice import MarkerBits, assign_ids
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
    bits = MarkerBits.of(charuco_board(target), target.square_mm)
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
