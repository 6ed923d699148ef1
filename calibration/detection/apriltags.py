"""AprilTag grids: tags are read by OpenCV, their corners are the crossings of fitted edges. Any tags suffice."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.detection.image import Grey, downscale, to_full_size
from calibration.detection.tag_edges import refine_squares
from calibration.errors import DetectionError
from calibration.problem import Detection
from calibration.targets import TAG_FAMILIES, AprilTagGrid, require_markers
from calibration.transforms import Array

SEARCH_PIXELS = (2.0e6, np.inf)
"""Pixels of the image that is searched, one after the other until all tags are found."""
EDGE_REACH_OF_MODULE = 0.8
"""Width of the band on either side of an edge that is read, as a share of a module or of the gap, if narrower."""


def detect_apriltags(image: Grey, target: AprilTagGrid) -> Detection:
    """Four corners of every tag in view, ids as in AprilTagGrid.

    Raises DetectionError `not-found`, `unknown-dictionary`, `dictionary-too-small`.
    """
    require_markers(target)
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, TAG_FAMILIES[target.family]))
    tags, rough = _read_tags(image, dictionary, target.columns * target.rows)
    if len(tags) == 0:
        what = f"no {target.family} tag of the grid was found"
        raise DetectionError("not-found", what, "bring the grid into view, without glare; check family, columns, rows")
    modules = dictionary.markerSize + 2
    clear = EDGE_REACH_OF_MODULE * min(1 / modules, target.gap_mm / target.tag_mm)
    ids = 4 * tags[:, None] + np.arange(4)
    corners = refine_squares(image, target.points_mm[ids, :2], rough, clear)
    return Detection(ids.ravel(), corners.reshape(-1, 2))


def _read_tags(image: Grey, dictionary: Any, count: int) -> tuple[NDArray[np.intp], Array]:
    """Numbers (n,) and rough corners (n, 4, 2) px of the tags in view; a number found more than once is left out."""
    detector = cv2.aruco.ArucoDetector(dictionary)
    tags, corners = np.zeros(0, np.intp), np.zeros((0, 4, 2))
    for pixels in SEARCH_PIXELS:
        small, factor = downscale(image, pixels)
        found, numbers, _ = detector.detectMarkers(small)
        if numbers is not None:
            tags, first, times = np.unique(np.ravel(numbers), return_index=True, return_counts=True)
            kept = (times == 1) & (tags < count)
            corners = to_full_size(np.array(found, float).reshape(-1, 4, 2)[first][kept], factor)
            tags = tags[kept].astype(np.intp)
        if len(tags) == count or factor == 1:
            break
    return tags, corners
