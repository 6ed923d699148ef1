"""What the camera sees of the target now, for an operator who jogs the arm."""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.detection.image import grey_image
from calibration.errors import DetectionError
from calibration.problem import Detection
from calibration.sentences.sentence import with_fix
from calibration.targets import Target
from calibration.transforms import Array
from daemon.runtime.clock import Clock
from daemon.runtime.shared_reading import RecentReading
from daemon.runtime.workers import Workers
from drivers.interfaces import CameraFrame, CaptureSettings

MAX_AGE_S = 0.5
"""The target is searched twice a second at most, however many ask."""

SATURATED_LEVEL = 254


@dataclass(frozen=True, eq=False)
class Quality:
    """Measures of one picture where the target is, or of all of it where it was not found.

    sharpness : standard deviation of the Laplacian over that of the grey levels: 0 for a uniform picture.
    saturated : share of pixels of SATURATED_LEVEL and more.
    fill : share of the picture within the outline of the target's points; 0 where it was not found.
    """

    sharpness: float
    saturated: float
    fill: float


@dataclass(frozen=True, eq=False)
class Look:
    """The target in one picture; `missing`: a code and a sentence where it was not found. `of`: points it has.

    `capture`: bits, exposure and gain, of a camera that reports them.
    """

    taken_at: str
    size: tuple[int, int]
    detection: Detection | None
    missing: tuple[str, str] | None
    of: int
    quality: Quality
    capture: CaptureSettings | None = None


def measure_quality(image: NDArray[np.uint8], corners_px: Array | None) -> Quality:
    """The measures of a grey picture (h, w) around the points (n, 2)."""
    height, width = image.shape
    fill, part = 0.0, image
    if corners_px is not None and len(corners_px) >= 3:
        hull = cv2.convexHull(corners_px.astype(np.float32))
        fill = float(cv2.contourArea(hull)) / (width * height)
        (left, top), (right, bottom) = np.floor(corners_px.min(0)).astype(int), np.ceil(corners_px.max(0)).astype(int)
        cut = image[max(top, 0) : bottom + 1, max(left, 0) : right + 1]
        part = cut if cut.size else image
    contrast = float(part.std())
    edges = float(np.std(np.asarray(cv2.Laplacian(part, cv2.CV_32F))))
    sharpness = edges / contrast if contrast > 0 else 0.0
    return Quality(sharpness, float(np.count_nonzero(part >= SATURATED_LEVEL)) / part.size, fill)


def look_at(frame: CameraFrame, target: Target, taken_at: str) -> Look:
    from calibration.detection.detect import detect  # not needed where nobody looks

    grey = frame.image.ndim == 2
    image = frame.image if grey else np.asarray(cv2.cvtColor(frame.image, cv2.COLOR_BGR2GRAY), np.uint8)
    detection, missing = None, None
    try:
        detection = detect(grey_image(frame.image), target)
    except DetectionError as error:
        missing = (error.code, with_fix(error.what, error.fix))
    quality = measure_quality(image, None if detection is None else detection.corners_px)
    size = (int(image.shape[1]), int(image.shape[0]))
    return Look(taken_at, size, detection, missing, len(target.points_mm), quality, frame.capture)


def share_looks(
    read_frame: Callable[[], Awaitable[CameraFrame]], target: Target, workers: Workers, clock: Clock
) -> RecentReading[Look]:
    """The target in a picture of at most the last MAX_AGE_S, for all who ask; a frame is that of `read_frame`."""

    async def look() -> Look:
        return await workers.run(look_at, await read_frame(), target, clock.timestamp())

    return RecentReading(look, clock.monotonic_s, MAX_AGE_S)
