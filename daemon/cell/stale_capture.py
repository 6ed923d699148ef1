"""Is what a device sends new? A sensor has noise: two captures from two poses are never the same to the last bit."""

from dataclasses import dataclass
from hashlib import blake2b

import numpy as np

from calibration.transforms import Array, difference
from daemon.errors import StaleCaptureError
from drivers.interfaces import Frame, PoseReading, ScannedCloud

MIN_DISTANCE_MM, MIN_ROTATION_RAD = 1.0, 1e-3
"""Nearer poses than these may show the same to a device that has no noise, as a drawn one."""


@dataclass
class StaleCaptureDetector:
    """Remembers the last capture of one device: what it was, and where the arm stood."""

    device: str
    _digest: bytes = b""
    _base_T_flange: Array | None = None

    def check_frame(self, frame: Frame, reading: PoseReading) -> None:
        """Raises SameAgain. Pictures without any contrast may be the same: they are told as what they are."""
        if np.ptp(frame.image):
            self._check(np.ascontiguousarray(frame.image).data, "picture", reading)

    def check_cloud(self, cloud: ScannedCloud, reading: PoseReading) -> None:
        """Raises SameAgain."""
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
