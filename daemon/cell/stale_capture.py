"""Detects stale captures: with a sensor's noise, captures from two poses are never identical to the last bit."""

from dataclasses import dataclass
from hashlib import blake2b

import numpy as np

from calibration.transforms import Array, difference
from daemon.errors import StaleCaptureError
from drivers.interfaces import CameraFrame, PoseReading, ScannedCloud

MIN_DISTANCE_MM, MIN_ROTATION_RAD = 1.0, 1e-3
"""Identical captures from poses nearer than this are accepted: a simulated device has no noise."""


@dataclass
class StaleCaptureDetector:
    """Keeps the hash and pose of one device's last capture."""

    device: str
    _digest: bytes = b""
    _base_T_flange: Array | None = None

    def check_frame(self, frame: CameraFrame, reading: PoseReading) -> None:
        """Raises StaleCaptureError for a repeated picture; not for one without contrast, which fails in detection."""
        if np.ptp(frame.image):
            self._check(np.ascontiguousarray(frame.image).data, "picture", reading)

    def check_cloud(self, cloud: ScannedCloud, reading: PoseReading) -> None:
        """Raises StaleCaptureError for a repeated cloud."""
        self._check(cloud.content, "cloud", reading)

    def _check(self, content: "bytes | memoryview", kind: str, reading: PoseReading) -> None:
        digest, before = blake2b(content, digest_size=16).digest(), self._base_T_flange
        same, self._digest = digest == self._digest, digest
        self._base_T_flange = reading.base_T_flange
        if not same or before is None:
            return
        apart_mm, apart_rad = difference(before, reading.base_T_flange)
        if apart_mm > MIN_DISTANCE_MM or apart_rad > MIN_ROTATION_RAD:
            raise StaleCaptureError(
                f"the {self.device} sent the same {kind} again, to the last bit, from a pose {apart_mm:.0f} mm away",
                f"see that the {self.device} takes a new {kind} for each request, or restart it",
            )
