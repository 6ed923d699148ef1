"""Detection of a target in an image: picks the target's detector and validates what it finds."""

from collections.abc import Callable
from typing import Any

import cv2
from numpy.typing import NDArray

from calibration.detection.charuco import detect_charuco
from calibration.detection.chessboard import detect_chessboard
from calibration.detection.circles import detect_circles
from calibration.detection.image import Grey, grey_image
from calibration.detection.markers import detect_markers
from calibration.detection.opencv_logging import silence_opencv
from calibration.detection.validation import validate_detection
from calibration.errors import DetectionError
from calibration.problem import Detection
from calibration.sentences.sentence import Sentence
from calibration.targets import AprilTagGrid, ArucoGrid, ArucoMarker, Charuco, Chessboard, CircleGrid, Target

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
