"""Detection of a target in an image: picks the target's detector and validates what it finds."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.detection.charuco import detect_charuco
from calibration.detection.chessboard import detect_chessboard
from calibration.detection.circles import detect_circles
from calibration.detection.image import Grey, downscale, grey_image, to_full_size
from calibration.detection.tag_edges import refine_squares
from calibration.detection.validation import validate_detection
from calibration.errors import DetectionError
from calibration.problem import Detection
from calibration.sentences.sentence import Sentence
from calibration.targets import (
    AprilTagGrid,
    ArucoGrid,
    ArucoMarker,
    Charuco,
    Chessboard,
    CircleGrid,
    MarkerGrid,
    MarkerTarget,
    Target,
    require_markers,
)
from calibration.transforms import Array

SEARCH_PIXELS = (2.0e6, np.inf)
"""Pixels of the image that is searched, one after the other until all markers are found."""
EDGE_REACH_OF_MODULE = 0.8
"""Width of the band on either side of an edge that is read, as a share of a module or of the gap, if narrower."""


def detect_markers(image: Grey, target: MarkerTarget) -> Detection:
    """Four corners of every marker in view, ids as in MarkerGrid.

    Raises DetectionError `not-found`, `unknown-dictionary`, `dictionary-too-small`.
    """
    require_markers(target)
    grid = target.markers
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, grid.dictionary))
    markers, rough = _read_markers(image, dictionary, grid)
    if len(markers) == 0:
        raise _not_found(target)
    modules = dictionary.markerSize + 2
    clear = EDGE_REACH_OF_MODULE * min(1 / modules, grid.gap_mm / grid.side_mm)
    ids = 4 * markers[:, None] + np.arange(4)
    corners = refine_squares(image, target.points_mm[ids, :2], rough, clear)
    return Detection(ids.ravel(), corners.reshape(-1, 2))


def _not_found(target: MarkerTarget) -> DetectionError:
    match target:
        case AprilTagGrid():
            what, settings = Sentence("seen-no-tag", family=target.family), "family, columns, rows"
        case ArucoGrid():
            what = Sentence("seen-no-grid-marker", dictionary=target.dictionary)
            settings = "dictionary, first_id, columns, rows"
        case ArucoMarker():
            what = Sentence("seen-no-marker", dictionary=target.dictionary, marker=target.id)
            settings = "dictionary and id"
    return DetectionError("not-found", what, Sentence("see-markers", settings=settings))


def _read_markers(image: Grey, dictionary: Any, grid: MarkerGrid) -> tuple[NDArray[np.intp], Array]:
    """Places (n,) in the grid and rough corners (n, 4, 2) px of its markers in view; one seen twice is left out."""
    detector = cv2.aruco.ArucoDetector(dictionary)
    tags, corners = np.zeros(0, np.intp), np.zeros((0, 4, 2))
    for pixels in SEARCH_PIXELS:
        small, factor = downscale(image, pixels)
        found, numbers, _ = detector.detectMarkers(small)
        if numbers is not None:
            tags, first, times = np.unique(np.ravel(numbers), return_index=True, return_counts=True)
            places = tags - grid.first
            kept = (times == 1) & (places >= 0) & (places < grid.count)
            corners = to_full_size(np.array(found, float).reshape(-1, 4, 2)[first][kept], factor)
            tags = places[kept].astype(np.intp)
        if len(tags) == grid.count or factor == 1:
            break
    return tags, corners


@contextmanager
def silence_opencv() -> Iterator[None]:
    """Context manager: OpenCV writes nothing to standard error inside it."""
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        cv2.utils.logging.setLogLevel(level)


Detector = Callable[[Grey, Any], Detection]

DETECTORS: dict[type, Detector] = {
    Chessboard: detect_chessboard,
    Charuco: detect_charuco,
    CircleGrid: detect_circles,
    AprilTagGrid: detect_markers,
    ArucoGrid: detect_markers,
    ArucoMarker: detect_markers,
}


def detect(image: NDArray[Any], target: Target) -> Detection:
    """The target's points in an 8-bit image (h, w) or (h, w, 3), refined to a fraction of a pixel and validated.

    Raises DetectionError; the codes stand in `grey_image`, each detector and `validate_detection`.
    """
    grey = grey_image(image)
    try:
        with silence_opencv():
            found = DETECTORS[type(target)](grey, target)
    except cv2.error as error:
        what = Sentence("seen-opencv-error", reason=str(error.err))
        raise DetectionError("not-found", what, Sentence("see-description-and-image")) from error
    return validate_detection(found, target, (grey.shape[1], grey.shape[0]))
