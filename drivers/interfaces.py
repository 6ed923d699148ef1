"""Devices as the daemon sees them: what a driver offers, and how it is constructed.

Hardware, replay and mock implement these in files of like size; drivers/registry.py names them by address. Times are
seconds of the monotonic clock handed to each driver at construction; a reading's `taken_at_s` is the earliest moment
its content can stem from, so that a stale picture can be told from a fresh one.
"""

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from calibration.transforms import Array
from drivers.timing import Timing

Posture = tuple[int, ...]
"""Which of the joint solutions of a pose an arm is in: four integers of its controller and its kinematics.

Everything else only hands it on: a pose that was read is gone to again with the posture it was read with.
"""


@dataclass(frozen=True)
class LinkHealth:
    """Is the device there? `detail` is a sentence for people; `since_s` when this state began."""

    connected: bool
    detail: str
    since_s: float


class Device(Protocol):
    """What every device offers. Constructing it opens nothing."""

    @property
    def link(self) -> LinkHealth: ...

    def start(self) -> None:
        """Begin to look for the device in the background, for ever; needs a running loop.

        Until it is found, and whenever it is lost, requests raise DeviceUnreachable.
        """
        ...

    async def close(self) -> None:
        """Let the device go; returns when nothing of it is open any more."""
        ...


@dataclass(frozen=True, eq=False)
class PoseReading:
    """Where the flange stands in the robot's base frame. `still`: the controller reports standstill.

    `external_axes` are the values of the axes beside the arm, as the controller numbers them.
    """

    base_T_flange: Array
    posture: Posture
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
    """Where to go. Joint interpolation to a stop point unless `path` says linear.

    `external_axes` are those of a PoseReading; empty: there are none.
    """

    base_T_flange: Array
    posture: Posture
    external_axes: tuple[float, ...] = ()
    speed_mm_s: float = 100.0
    path: Literal["joint", "linear"] = "joint"


class RobotCapabilities(NamedTuple):
    """What a robot can do, and how its controller gives poses.

    `moves`: False for one that is only read; arming it raises RequestRefused, and moving it MoveRefused.
    `pose_convention`: frames, unit and quaternion order at the controller, for messages.
    """

    moves: bool
    pose_convention: str


class Robot(Device, Protocol):
    """An arm on a controller: disarmed after every (re)connection, and a move that was cut off is never repeated."""

    @property
    def capabilities(self) -> RobotCapabilities: ...

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


@dataclass(frozen=True)
class Vibration:
    """How far the flange was from its mean within a window. `lost`: samples that were sent and did not come."""

    translation_mm: float
    rotation_rad: float
    samples: int
    lost: int


class VibrationMonitor(Protocol):
    """A stream of the flange's poses beside the robot, quick enough to see it ring."""

    def vibration(self, window_s: float) -> Vibration:
        """Within the last `window_s`. Raises DeviceTimeout when the controller sends nothing."""
        ...

    def close(self) -> None: ...


@dataclass(frozen=True, eq=False)
class Frame:
    """An image: uint8 (h, w) grey or (h, w, 3) BGR. `encoded` is the file it came as, when it came as one."""

    image: NDArray[np.uint8]
    taken_at_s: float
    encoded: bytes | None = None


class Camera(Device, Protocol):
    """A camera on the flange."""

    async def grab(self, newer_than_s: float) -> Frame:
        """A frame exposed after `newer_than_s`; raises a DeviceError when none comes in time."""
        ...


@dataclass(frozen=True)
class ScannedCloud:
    """A cloud in the scanner's frame as the file it came as."""

    content: bytes
    media_type: Literal["application/x-ply", "application/x-pcd"]
    taken_at_s: float


class Scanner(Device, Protocol):
    """A 3D scanner on the flange."""

    async def scan(self, newer_than_s: float) -> ScannedCloud:
        """A cloud captured after `newer_than_s`; raises a DeviceError when none comes in time."""
        ...


class MakeRobot(Protocol):
    """The constructor of a robot driver. `source` is what its scheme's parser in the registry made of the address."""

    def __call__(self, source: Any, timing: Timing, /) -> Robot: ...


class MakeCamera(Protocol):
    """The constructor of a camera driver; `source` as for a robot.

    A frame of another size than `image_size` (width, height) is refused with GarbledAnswer; None allows any.
    `limit_s` is how long `grab` waits after `newer_than_s`.
    """

    def __call__(
        self, source: Any, timing: Timing, /, *, image_size: tuple[int, int] | None, limit_s: float
    ) -> Camera: ...


class MakeScanner(Protocol):
    """The constructor of a scanner driver; `source` as for a robot, `limit_s` as for a camera.

    A cloud of more than `max_bytes` is refused with AnswerTooLarge.
    """

    def __call__(self, source: Any, timing: Timing, /, *, limit_s: float, max_bytes: int) -> Scanner: ...
