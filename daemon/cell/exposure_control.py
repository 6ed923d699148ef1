"""Exposure and gain chosen for the target: its white below saturation, its black above noise, within the user's limits.

A sensor is linear, so one picture that is neither black nor saturated gives the factor to the wanted level.
"""

from collections.abc import Awaitable, Callable
from math import log10

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.errors import DetectionError
from calibration.targets import Target
from calibration.transforms import Array
from daemon.config.settings import ExposureSettings
from daemon.runtime.clock import Clock
from daemon.runtime.workers import Workers
from drivers.interfaces import AdjustableCamera, Camera, CameraFrame, Exposure, ExposureRange

WANTED_WHITE = 195.0
"""Grey level, of 255, for the target's white: shading leaves its brightest part below saturation."""
MIN_WHITE, MAX_WHITE = 170.0, 225.0
"""Grey levels of the target's white between which nothing is changed."""
SATURATED_LEVEL, MAX_SATURATED = 250, 0.005
"""A picture with a larger share of pixels at this level is too bright by an unknown factor."""
STEP_DOWN, MAX_STEP_UP = 0.3, 12.0
"""Factor for a saturated picture, and the largest for a dark one, whose level is mostly noise."""
WHITE_PERCENTILE = 97.0
MAX_STEPS = 6
"""Pictures after which the exposure stays: from 1/1000 to 1000 times the right one it takes five."""


def within(user: ExposureSettings, camera: ExposureRange) -> ExposureRange:
    """What both allow; where they do not meet, what the camera can that is nearest to the user's limits."""
    return ExposureRange(_overlap(user.exposure_us, camera.exposure_us), _overlap(user.gain_db, camera.gain_db))


def next_exposure(
    image: NDArray[np.uint8], corners_px: Array | None, now: Exposure, limits: ExposureRange
) -> Exposure | None:
    """The exposure that brings the target's white to WANTED_WHITE; None when it is well, or nothing more can be done.

    `image` (h, w) grey; `corners_px` (n, 2): the target's points, None where it was not found: the whole image counts.
    Longer exposure goes before gain, and gain is taken back first: gain adds noise.
    """
    part = _target_part(image, corners_px)
    white = float(np.percentile(part, WHITE_PERCENTILE))
    saturated = float(np.count_nonzero(part >= SATURATED_LEVEL)) / part.size
    if saturated <= MAX_SATURATED and MIN_WHITE <= white <= MAX_WHITE:
        return None
    factor = STEP_DOWN if saturated > MAX_SATURATED else min(WANTED_WHITE / max(white, 1.0), MAX_STEP_UP)
    light = now.exposure_us * 10 ** (now.gain_db / 20) * factor
    exposure_us = _clamped(light / 10 ** (limits.gain_db[0] / 20), limits.exposure_us)
    gain_db = _clamped(20 * log10(light / exposure_us), limits.gain_db)
    change = exposure_us * 10 ** (gain_db / 20) / (now.exposure_us * 10 ** (now.gain_db / 20))
    return None if abs(change - 1) < 0.02 else Exposure(exposure_us, gain_db)


class ExposureControl:
    """Adjusts a camera by the pictures that it takes; nothing for a camera that cannot be adjusted."""

    def __init__(
        self, camera: Camera, target: Target, limits: ExposureSettings, workers: Workers, clock: Clock
    ) -> None:
        self._camera, self._target, self.limits = camera, target, limits
        self._workers, self._clock = workers, clock

    async def expose(self, grab: Callable[[float], Awaitable[CameraFrame]], newer_than_s: float) -> CameraFrame:
        """A frame exposed after `newer_than_s`, well exposed as far as the limits allow. Raises DeviceError."""
        frame = await grab(newer_than_s)
        if not isinstance(self._camera, AdjustableCamera):
            return frame
        for _ in range(MAX_STEPS - 1):
            state = await self._camera.read_exposure()
            if state is None:
                break
            now, camera_range = state
            wanted = await self._workers.run(self._search, frame.image, now, within(self.limits, camera_range))
            if wanted is None:
                break
            await self._camera.set_exposure(wanted)
            frame = await grab(self._clock.monotonic_s())
        return frame

    def _search(self, image: NDArray[np.uint8], now: Exposure, limits: ExposureRange) -> Exposure | None:
        from calibration.detection.detect import detect  # not needed where no limits are set

        grey = image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)
        try:
            corners_px: Array | None = detect(image, self._target).corners_px
        except DetectionError:
            corners_px = None
        return next_exposure(grey, corners_px, now, limits)


def _target_part(image: NDArray[np.uint8], corners_px: Array | None) -> NDArray[np.uint8]:
    """The pixels (n,) within the hull of the target's points; those of the whole image without."""
    if corners_px is None or len(corners_px) < 3:
        return image.reshape(-1)
    hull = cv2.convexHull(corners_px.astype(np.float32)).astype(np.int32)
    mask = cv2.fillConvexPoly(np.zeros(image.shape, np.uint8), hull, 1)
    part = image[np.asarray(mask) > 0]
    return part if part.size else image.reshape(-1)


def _overlap(user: tuple[float, float], camera: tuple[float, float]) -> tuple[float, float]:
    return _clamped(user[0], camera), _clamped(user[1], camera)


def _clamped(value: float, bounds: tuple[float, float]) -> float:
    return min(max(value, bounds[0]), bounds[1])
