"""Named faults of camera and scanner, and the board that switches them.

A fault acts in up to four places: before the capture (`delay_s`, `status`), in the scene (`hides_target`), on captured
data (`picture`, `points`) and on the encoded file (`content`). New faults are new rows.
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
    """One fault. `strikes`: how many captures it affects by default; None: until cleared.

    `repeats`: the previous file is sent again, with its true age (`honest`) or as if new (`lying`).
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
    DeviceFault("camera-late", "camera", f"the picture comes {LATE_S:.0f} s late", delay_s=LATE_S),
    DeviceFault("camera-away", "camera", "the camera answers 503", status=503),
    DeviceFault("camera-repeated", "camera", "the previous picture comes again as if new", None, repeats="lying"),
    DeviceFault("camera-stale", "camera", "the previous picture comes with its true age", None, repeats="honest"),
    DeviceFault("camera-black", "camera", "the picture is black", picture=np.zeros_like),
    DeviceFault("camera-saturated", "camera", "the picture is white", picture=lambda p: np.full_like(p, 255)),
    DeviceFault("camera-torn", "camera", "the lower half of the picture is shifted", picture=_tear),
    DeviceFault("camera-wrong-size", "camera", "the picture has half the size", picture=lambda p: p[::2, ::2].copy()),
    DeviceFault("camera-half-file", "camera", "half of the file comes", content=_half),
    DeviceFault("camera-empty-file", "camera", "a file of 0 bytes comes", content=lambda content: b""),
    DeviceFault("camera-target-hidden", "camera", "something covers the target", hides_target=True),
    DeviceFault("scanner-late", "scanner", f"the cloud comes {LATE_S:.0f} s late", delay_s=LATE_S),
    DeviceFault("scanner-away", "scanner", "the scanner answers 503", status=503),
    DeviceFault("scanner-repeated", "scanner", "the previous cloud comes again as if new", None, repeats="lying"),
    DeviceFault("scanner-stale", "scanner", "the previous cloud comes with its true age", None, repeats="honest"),
    DeviceFault("scanner-empty", "scanner", "the cloud has no points", points=lambda points: points[:0]),
    DeviceFault("scanner-nan", "scanner", "every tenth point is NaN", points=_with_holes),
    DeviceFault("scanner-half-file", "scanner", "half of the file comes", content=_half),
)

DEVICE_FAULTS: Mapping[str, DeviceFault] = MappingProxyType({fault.name: fault for fault in _ROWS})


@dataclass
class DeviceFaultBoard:
    """The faults that are on; thread-safe."""

    table: Mapping[str, DeviceFault] = field(default_factory=lambda: DEVICE_FAULTS)
    _strikes_left: dict[str, int | None] = field(default_factory=dict, init=False)
    _lock: threading.Lock = field(default_factory=threading.Lock, init=False)

    @property
    def active(self) -> tuple[str, ...]:
        """Names of the faults that are on."""
        with self._lock:
            return tuple(self._strikes_left)

    def switch_on(self, name: str, strikes: int | None = None) -> None:
        """Switch on from the next capture, for `strikes` captures (None: the row's default). Raises UnknownFault."""
        if name not in self.table:
            raise UnknownFault(name, tuple(self.table))
        with self._lock:
            self._strikes_left[name] = self.table[name].strikes if strikes is None else strikes

    def clear(self, name: str | None = None) -> None:
        """Switch one fault off, or all of them. Raises UnknownFault."""
        if name is not None and name not in self.table:
            raise UnknownFault(name, tuple(self.table))
        with self._lock:
            for known in list(self._strikes_left) if name is None else [name]:
                self._strikes_left.pop(known, None)

    def strike(self, device: Device) -> tuple[DeviceFault, ...]:
        """Faults that affect this capture; each loses one strike."""
        with self._lock:
            struck = tuple(self.table[name] for name in self._strikes_left if self.table[name].area == device)
            for fault in struck:
                left = self._strikes_left[fault.name]
                if left is not None and left <= 1:
                    del self._strikes_left[fault.name]
                elif left is not None:
                    self._strikes_left[fault.name] = left - 1
            return struck
