"""Devices as the daemon sees them. Hardware, replay and mock implement these in files of like size.

Times are seconds of the monotonic clock handed to each driver at construction; a reading's `taken_at_s` is the
earliest moment its content can stem from, so that a stale picture can be told from a fresh one.
"""

from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from calibration.transforms import Array

UNUSED_AXIS = 9e9
"""ABB's value for an external axis that is not there; compare with >= 8.9e9."""


class Configuration(NamedTuple):
    """ABB confdata: quarter turns of axes 1, 4, 6, and cfx. Echo it on a move, or the posture may change."""

    cf1: int
    cf4: int
    cf6: int
    cfx: int


@dataclass(frozen=True, eq=False)
class PoseReading:
    """Where tool0 stands in wobj0. `still`: the controller reports standstill."""

    base_T_flange: Array
    configuration: Configuration
    external_axes: tuple[float, ...]
    still: bool
    taken_at_s: float


@dataclass(frozen=True)
class RobotStatus:
    """What the controller says of itself. `speed_limited`: a speed override or manual mode holds the arm back."""

    motors_on: bool
    automatic: bool
    emergency_stop: bool
    moving: bool
    in_position: bool
    armed: bool
    program_running: bool
    speed_limited: bool
    taken_at_s: float


@dataclass(frozen=True, eq=False)
class MoveGoal:
    """Where to go. Joint interpolation to a stop point unless `path` says linear."""

    base_T_flange: Array
    configuration: Configuration
    external_axes: tuple[float, ...] = (UNUSED_AXIS,) * 6
    speed_mm_s: float = 100.0
    path: Literal["joint", "linear"] = "joint"


@dataclass(frozen=True)
class LinkHealth:
    """Is the device there? `detail` is a sentence for people; `since_s` when this state began."""

    connected: bool
    detail: str
    since_s: float


class Robot(Protocol):
    """An arm on a controller: disarmed after every (re)connection, and a move that was cut off is never repeated."""

    @property
    def link(self) -> LinkHealth: ...

    async def read_pose(self) -> PoseReading: ...

    async def read_joints(self) -> Array:
        """Axis angles (6,) in rad."""
        ...

    async def read_status(self) -> RobotStatus: ...

    async def set_armed(self, armed: bool) -> None: ...

    async def move_to(self, goal: MoveGoal) -> None:
        """Returns when the arm stands at the goal; raises a DeviceError otherwise. Cancelling it stops the arm."""
        ...

    async def stop(self) -> None:
        """Stop now, whatever else runs."""
        ...

    async def close(self) -> None: ...


@dataclass(frozen=True, eq=False)
class Frame:
    """An image: uint8 (h, w) grey or (h, w, 3) BGR. `encoded` is the file it came as, when it came as one."""

    image: NDArray[np.uint8]
    taken_at_s: float
    encoded: bytes | None = None


class Camera(Protocol):
    """A camera on the flange."""

    @property
    def link(self) -> LinkHealth: ...

    async def grab(self, newer_than_s: float) -> Frame:
        """A frame exposed after `newer_than_s`; raises a DeviceError when none comes in time."""
        ...

    async def close(self) -> None: ...


@dataclass(frozen=True)
class ScannedCloud:
    """A cloud in the scanner's frame as the file it came as."""

    content: bytes
    media_type: Literal["application/x-ply", "application/x-pcd"]
    taken_at_s: float


class Scanner(Protocol):
    """A 3D scanner on the flange."""

    @property
    def link(self) -> LinkHealth: ...

    async def scan(self, newer_than_s: float) -> ScannedCloud:
        """A cloud captured after `newer_than_s`; raises a DeviceError when none comes in time."""
        ...

    async def close(self) -> None: ...
