"""Table of named faults of camera and scanner."""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from mock_robot.faults.board import DeviceFault, Picture, Points

LATE_S = 5.0


def _tear(picture: Picture) -> Picture:
    """Shift the lower half by a sixteenth of the width, as a readout that lost synchronisation does."""
    torn = picture.copy()
    half = len(picture) // 2
    torn[half:] = np.roll(picture[half:], picture.shape[1] // 16, axis=1)
    return torn


def _with_holes(points: Points) -> Points:
    """Set every tenth point to NaN, as scanners mark pixels without a measurement."""
    holes = points.copy()
    holes[::10] = np.nan
    return holes


def _half(content: bytes) -> bytes:
    return content[: len(content) // 2]


_ROWS = (
    DeviceFault("camera-late", f"the picture comes {LATE_S:.0f} s late", delay_s=LATE_S),
    DeviceFault("camera-away", "the camera answers 503", status=503),
    DeviceFault("camera-repeated", "the previous picture comes again as if new", None, repeats="lying"),
    DeviceFault("camera-stale", "the previous picture comes with its true age", None, repeats="honest"),
    DeviceFault("camera-black", "the picture is black", picture=np.zeros_like),
    DeviceFault("camera-saturated", "the picture is white", picture=lambda p: np.full_like(p, 255)),
    DeviceFault("camera-torn", "the lower half of the picture is shifted", picture=_tear),
    DeviceFault("camera-wrong-size", "the picture has half the size", picture=lambda p: p[::2, ::2].copy()),
    DeviceFault("camera-half-file", "half of the file comes", content=_half),
    DeviceFault("camera-empty-file", "a file of 0 bytes comes", content=lambda content: b""),
    DeviceFault("camera-target-hidden", "something covers the target", hides_target=True),
    DeviceFault("scanner-late", f"the cloud comes {LATE_S:.0f} s late", delay_s=LATE_S),
    DeviceFault("scanner-away", "the scanner answers 503", status=503),
    DeviceFault("scanner-repeated", "the previous cloud comes again as if new", None, repeats="lying"),
    DeviceFault("scanner-stale", "the previous cloud comes with its true age", None, repeats="honest"),
    DeviceFault("scanner-empty", "the cloud has no points", points=lambda points: points[:0]),
    DeviceFault("scanner-nan", "every tenth point is NaN", points=_with_holes),
    DeviceFault("scanner-half-file", "half of the file comes", content=_half),
)

DEVICE_FAULTS: Mapping[str, DeviceFault] = MappingProxyType({fault.name: fault for fault in _ROWS})
