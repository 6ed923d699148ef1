"""ChArUco boards: the chessboard's corners are found first, and the markers tell which of them they are.

Where too few corners join, OpenCV's detector looks for markers one by one. Then every inner corner is looked for where
those found put it.
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.detection.charuco_lattice import Bits, numbered
from calibration.detection.chessboard import plane_through, without_loose_lines
from calibration.detection.crossings import find_crossings
from calibration.detection.image import Grey, at_full_size, reduced
from calibration.detection.lattice import grow_lattices
from calibration.detection.plane_view import fit_plane_view
from calibration.detection.saddle import refine_saddles
from calibration.detection.squares import narrowest_side, window_px
from calibration.errors import DetectionError
from calibration.problem import Detection
from calibration.targets import Charuco
from calibration.transforms import Array

LATTICE_PIXELS, RING_RADII_PX, FEWEST_JOINED = 1.3e6, (4.0, 2.5), 9
MARKER_PIXELS = (1.5e6, np.inf)
"""Markers too small to be read in the reduced image may be readable in the full one."""
FEWEST_CORNERS, ENOUGH_OF_BOARD = 4, 0.5
NOTHING = Detection(np.empty(0, np.intp), np.empty((0, 2)))
ROUNDS = 3
FURTHEST_OF_SPACING = 0.25
"""How far a corner may lie from where the others put it, before the lens is known."""


def detect_charuco(image: Grey, target: Charuco) -> Detection:
    """The inner corners in view, ids as OpenCV numbers them.

    Raises DetectionError `not-found`, `unknown-dictionary`, `dictionary-too-small`.
    """
    board = charuco_board(target)
    rough = _by_lattice(image, target, board)
    if len(rough.ids) < ENOUGH_OF_BOARD * len(target.points_mm):
        rough = max(rough, _by_markers(image, board), key=lambda found: len(found.ids))
    if len(rough.ids) >= FEWEST_CORNERS:
        return _complete(image, target, rough.ids, rough.corners_px)
    what = f"no ChArUco board of {target.columns}×{target.rows} squares ({target.dictionary}) was found"
    raise DetectionError("not-found", what, "bring the board into view, without glare; check dictionary, columns, rows")


def _by_lattice(image: Grey, target: Charuco, board: Any) -> Detection:
    small, factor = reduced(image, LATTICE_PIXELS)
    bits = Bits.of(board, target.square_mm)
    for radius_px in RING_RADII_PX:
        for grown in grow_lattices(find_crossings(small, radius_px), FEWEST_JOINED):
            lattice = without_loose_lines(grown)
            view = plane_through(lattice, (small.shape[1], small.shape[0]))
            found = None if view is None else numbered(small, target, bits, lattice, view)
            if found is not None:
                return Detection(found.ids, at_full_size(found.corners_px, factor))
    return NOTHING


def _by_markers(image: Grey, board: Any) -> Detection:
    detector = cv2.aruco.CharucoDetector(board)
    for pixels in MARKER_PIXELS:
        small, factor = reduced(image, pixels)
        corners, ids, _, _ = detector.detectBoard(small)
        if ids is not None and len(ids) >= FEWEST_CORNERS:
            return Detection(np.ravel(ids).astype(np.intp), at_full_size(np.reshape(corners, (-1, 2)), factor))
        if factor == 1:
            break
    return NOTHING


def charuco_board(target: Charuco) -> Any:
    """OpenCV's board. Raises DetectionError `unknown-dictionary`, `dictionary-too-small`."""
    number = getattr(cv2.aruco, target.dictionary, None) if target.dictionary.startswith("DICT_") else None
    if number is None:
        what = f"the dictionary {target.dictionary!r} is not known"
        raise DetectionError("unknown-dictionary", what, "use one of OpenCV's, like DICT_5X5_100")
    dictionary, needed = cv2.aruco.getPredefinedDictionary(number), target.columns * target.rows // 2
    if needed > len(dictionary.bytesList):
        what = f"{target.dictionary} has {len(dictionary.bytesList)} markers, the board of this size {needed}"
        raise DetectionError("dictionary-too-small", what, "check the dictionary, columns and rows")
    board = cv2.aruco.CharucoBoard((target.columns, target.rows), target.square_mm, target.marker_mm, dictionary)
    board.setLegacyPattern(target.legacy)
    return board


def _complete(image: Grey, target: Charuco, ids: NDArray[np.intp], corners: Array) -> Detection:
    """Every corner that is a saddle close to where the plane through the `corners` so far puts it."""
    found = Detection(ids, corners)
    for _ in range(ROUNDS):
        found = _looked_for(image, target, found)
        if not len(ids) < len(found.ids) < len(target.points_mm):
            break
        ids = found.ids
    return found


def _looked_for(image: Grey, target: Charuco, known: Detection) -> Detection:
    size = (image.shape[1], image.shape[0])
    points = target.points_mm[:, :2]
    view, _ = fit_plane_view(points[known.ids], known.corners_px, size)
    expected = view.map(points)
    expected[known.ids] = known.corners_px
    right, down = np.array([target.square_mm, 0.0]), np.array([0.0, target.square_mm])
    spacing = narrowest_side(view.map(points + right) - view.map(points), view.map(points + down) - view.map(points))
    half = window_px(spacing[known.ids], _clear_of_square(target))
    inside = np.all((expected > half) & (expected < np.array(size) - 1 - half), axis=1)
    candidates = np.flatnonzero(inside)
    refined, settled = refine_saddles(image, expected[candidates], half)
    near = np.hypot(*(refined - expected[candidates]).T) < FURTHEST_OF_SPACING * spacing[candidates]
    return Detection(candidates[settled & near], refined[settled & near])


def _clear_of_square(target: Charuco) -> float:
    """How far from a corner, in squares, the markers begin."""
    return float(np.sqrt(0.5) * (target.square_mm - target.marker_mm) / target.square_mm)
