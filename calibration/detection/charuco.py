"""ChArUco boards: markers read in a reduced image, then every inner corner looked for where the markers put it."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.detection.image import Grey, at_full_size, reduced
from calibration.detection.plane_view import fit_plane_view
from calibration.detection.saddle import refine_saddles
from calibration.errors import DetectionError
from calibration.problem import Detection
from calibration.targets import Charuco
from calibration.transforms import Array

SEARCH_PIXELS = (1.5e6, np.inf)
"""Markers too small to be read in the reduced image may be readable in the full one."""
FEWEST_CORNERS = 4
WINDOW_OF_SPACING = 0.3
SMALLEST_WINDOW_PX, LARGEST_WINDOW_PX = 2, 9
FURTHEST_OF_SPACING = 0.25
"""How far a corner may lie from where the others put it, before the lens is known."""


def detect_charuco(image: Grey, target: Charuco) -> Detection:
    """The inner corners in view, ids as OpenCV numbers them.

    Raises DetectionError `not-found`, `unknown-dictionary`.
    """
    detector = cv2.aruco.CharucoDetector(charuco_board(target))
    for pixels in SEARCH_PIXELS:
        small, factor = reduced(image, pixels)
        corners, ids, _, _ = detector.detectBoard(small)
        if ids is not None and len(ids) >= FEWEST_CORNERS:
            rough = at_full_size(np.asarray(corners, float).reshape(-1, 2), factor)
            return _complete(image, target, np.asarray(ids, np.intp).ravel(), rough)
    what = f"no ChArUco board of {target.columns}×{target.rows} squares ({target.dictionary}) was found"
    raise DetectionError("not-found", what, "bring the board into view, without glare; check dictionary, columns, rows")


def charuco_board(target: Charuco) -> Any:
    """OpenCV's board. Raises DetectionError `unknown-dictionary`."""
    number = getattr(cv2.aruco, target.dictionary, None) if target.dictionary.startswith("DICT_") else None
    if number is None:
        what = f"the dictionary {target.dictionary!r} is not known"
        raise DetectionError("unknown-dictionary", what, "use one of OpenCV's, like DICT_5X5_100")
    dictionary = cv2.aruco.getPredefinedDictionary(number)
    size = (target.columns, target.rows)
    board = cv2.aruco.CharucoBoard(size, target.square_mm, target.marker_mm, dictionary)
    board.setLegacyPattern(target.legacy)
    return board


def _complete(image: Grey, target: Charuco, ids: NDArray[np.intp], rough: Array) -> Detection:
    """Every corner that is a saddle close to where the plane through the `rough` ones puts it."""
    size = (image.shape[1], image.shape[0])
    points = target.points_mm[:, :2]
    view, _ = fit_plane_view(points[ids], rough, size)
    expected = view.map(points)
    expected[ids] = rough
    sides = view.map(points + np.array([target.square_mm, 0.0])) - view.map(points)
    downs = view.map(points + np.array([0.0, target.square_mm])) - view.map(points)
    spacing = np.minimum(np.hypot(*sides.T), np.hypot(*downs.T))
    half = int(np.clip(round(WINDOW_OF_SPACING * float(spacing[ids].min())), SMALLEST_WINDOW_PX, LARGEST_WINDOW_PX))
    inside = np.all((expected > half) & (expected < np.array(size) - 1 - half), axis=1)
    candidates = np.flatnonzero(inside)
    refined, settled = refine_saddles(image, expected[candidates], half)
    near = np.hypot(*(refined - expected[candidates]).T) < FURTHEST_OF_SPACING * spacing[candidates]
    return Detection(candidates[settled & near], refined[settled & near])
