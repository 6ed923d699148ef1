"""Named faults of camera and scanner as a table, and the board on which they are switched on.

A fault may strike at four places: before the capture (`delay_s`, `status`), in the scene (`hides_target`), in what was
captured (`picture`, `points`) and in the file on its way out (`content`). Adding a fault is adding a row.
"""

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mock_robot.errors import UnknownFault

Picture = NDArray[np.uint8]
Points = NDArray[np.float32]
Device = Literal["camera", "scanner"]

LATE_S = 5.0


@dataclass(frozen=True)
class DeviceFault:
    """One row. `strikes` is how many captures it spoils unless told otherwise; None until it is cleared.

    `repeats`: the previous file comes again, with its true age (`honest`) or as if it were new (`lying`).
    """

    name: str
    area: Device
    summary: str
    strikes: int | None = 1
    delay_s: float = 0.0
    status: int = 200
    hides_target: bool = False
    repeats: Literal["no", "honest", "lying"] = "no"
    picture: Callable[[Picture], Picture] | None = None
    points: Callable[[Points], Points] | None = None
    content: Callable[[bytes], bytes] | None = None


def _torn(picture: Picture) -> Picture:
    """The lower half comes from a readout that lost its place: shifted by a sixteenth of the width."""
    torn = picture.copy()
    half = len(picture) // 2
    torn[half:] = np.roll(picture[half:], picture.shape[1] // 16, axis=1)
    return torn


def _with_holes(points: Points) -> Points:
    """Every tenth point is NaN, as scanners mark pixels without a measurement."""
    holes = points.copy()
    holes[::10] = np.nan
    return holes


def _half(content: bytes) -> bytes:
    return content[: len(content) // 2]


_ROWS = (
    DeviceFault("camera-late", "camera", f"the picture comes {LATE_S:.0f} s late", delay_s=LATE_S),
    DeviceFault("camera-away", "camera", "the camera answers 503", status=503),
    DeviceFault("camera-repeated", "camera", "the previous picture comes again as if new", None, repeats="lying"),
    DeviceFault("camera-stale", "camera", "the previous picture comes again, its age told", None, repeats="honest"),
    DeviceFault("camera-black", "camera", "the picture is black", picture=np.zeros_like),
    DeviceFault("camera-saturated", "camera", "the picture is white", picture=lambda p: np.full_like(p, 255)),
    DeviceFault("camera-torn", "camera", "the lower half of the picture is shifted", picture=_torn),
    DeviceFault("camera-wrong-size", "camera", "the picture has half the size", picture=lambda p: p[::2, ::2].copy()),
    DeviceFault("camera-half-file", "camera", "half of the file comes", content=_half),
    DeviceFault("camera-empty-file", "camera", "a file of 0 bytes comes", content=lambda content: b""),
    DeviceFault("camera-target-hidden", "camera", "something covers the target", hides_target=True),
    DeviceFault("scanner-late", "scanner", f"the cloud comes {LATE_S:.0f} s late", delay_s=LATE_S),
    DeviceFault("scanner-away", "scanner", "the scanner answers 503", status=503),
    DeviceFault("scanner-repeated", "scanner", "the previous cloud comes again as if new", None, repeats="lying"),
    DeviceFault("scanner-stale", "scanner", "the previous cloud comes again, its age told", None, repeats="honest"),
    DeviceFault("scanner-empty", "scanner", "the cloud has no points", points=lambda points: points[:0]),
    DeviceFault("scanner-nan", "scanner", "every tenth point is NaN", points=_with_holes),
    DeviceFault("scanner-half-file", "scanner", "half of the file comes", content=_half),
)

DEVICE_FAULTS: Mapping[str, DeviceFault] = MappingProxyType({fault.name: fault for fault in _ROWS})


@dataclass
class DeviceFaultBoard:
    """Which faults are on; safe to switch from any thread."""

    table: Mapping[str, DeviceFault] = field(default_factory=lambda: DEVICE_FAULTS)
    _strikes_left: dict[str, int | None] = field(default_factory=dict, init=False)
    _lock: threading.Lock = field(default_factory=threading.Lock, init=False)

    @property
    def active(self) -> tuple[str, ...]:
        """Names of the faults that are on."""
        with self._lock:
            return tuple(self._strikes_left)

    def switch_on(self, name: str, strikes: int | None = None) -> None:
        """From the next capture on, for `strikes` captures (None: the row's own number). Raises UnknownFault."""
        if name not in self.table:
            raise UnknownFault(name, tuple(self.table))
        with self._lock:
            self._strikes_left[name] = self.table[name].strikes if strikes is None else strikes

    def clear(self, name: str | None = None) -> None:
        """Switch one fault off, or all. Raises UnknownFault."""
        if name is not None and name not in self.table:
            raise UnknownFault(name, tuple(self.table))
        with self._lock:
            for known in list(self._strikes_left) if name is None else [name]:
                self._strikes_left.pop(known, None)

    def strike(self, device: Device) -> tuple[DeviceFault, ...]:
        """The faults that spoil this capture; each uses up one strike."""
        with self._lock:
            struck = tuple(self.table[name] for name in self._strikes_left if self.table[name].area == device)
            for fault in struck:
                left = self._strikes_left[fault.name]
                if left is not None and left <= 1:
                    del self._strikes_left[fault.name]
                elif left is not None:
                    self._strikes_left[fault.name] = left - 1
            return struck
