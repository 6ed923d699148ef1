"""Interfaces of devices: what a driver offers, and how it is constructed.

Hardware, replay and mock drivers implement these; drivers/registry.py finds them by address. Times are seconds of the
monotonic clock given to each driver at construction; a reading's `taken_at_s` is the earliest moment its content can
stem from, which separates stale data from fresh.
"""

from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from calibration.transforms import Array
from drivers.timing import Timing

if TYPE_CHECKING:
    from registration.profiles.profile_block import ProfileBlock

Posture = tuple[int, ...]
"""Which of the joint solutions of a pose an arm is in: four integers of its controller and its kinematics.

Opaque elsewhere: a pose that was read is approached again with the posture it was read with.
"""


@dataclass(frozen=True)
class LinkHealth:
    """Whether the device is connected. `detail` is a sentence for people; `since_s`: start of this state."""

    connected: bool
    detail: str
    since_s: float


class Device(Protocol):
    """Interface of every device. The constructor opens nothing."""

    @property
    def link(self) -> LinkHealth: ...

    def start(self) -> None:
        """Start connecting in the background, permanently; needs a running loop.

        While disconnected, requests raise DeviceUnreachable.
        """
        ...

    async def close(self) -> None:
        """Close the device; returns when nothing of it is open any more."""
        ...


@dataclass(frozen=True, eq=False)
class PoseReading:
    """Flange pose in the robot's base frame. `still`: the controller reports standstill.

    `external_axes`: values of axes other than the arm's, in the controller's order. `joints_rad` (n,): the arm's
    axes at rest there, None in a reading of the pose alone. `arm_angle_deg`: of an arm with seven axes.
    """

    base_T_flange: Array
    posture: Posture
    external_axes: tuple[float, ...]
    still: bool
    taken_at_s: float
    joints_rad: Array | None = None
    arm_angle_deg: float | None = None


@dataclass(frozen=True)
class RobotStatus:
    """State of the controller. `speed_limited`: a speed override or manual mode slows the arm."""

    motors_on: bool
    automatic: bool
    emergency_stop: bool
    moving: bool
    in_position: bool
    armed: bool
    program_running: bool
    speed_limited: bool
    taken_at_s: float


@dataclass(frozen=True)
class Standstill:
    """What a controller confirms of a stop. `standing`: no move is in progress or pending; `disarmed`: none begins."""

    standing: bool
    disarmed: bool


@dataclass(frozen=True, eq=False)
class MoveGoal:
    """Target of a move: joint interpolation to a stop point unless `path` is linear.

    `external_axes` and `arm_angle_deg` as in PoseReading; `external_axes` empty when there are none.
    """

    base_T_flange: Array
    posture: Posture
    external_axes: tuple[float, ...] = ()
    speed_mm_s: float = 100.0
    path: Literal["joint", "linear"] = "joint"
    arm_angle_deg: float | None = None


@dataclass(frozen=True, eq=False)
class JointGoal:
    """Axis angles (n,) in rad to move to, for the first pose and for jogging; `speed_mm_s` of the flange.

    External axes stay where they are when `external_axes` is empty.
    """

    joints_rad: Array
    external_axes: tuple[float, ...] = ()
    speed_mm_s: float = 50.0


@dataclass(frozen=True)
class RobotSetup:
    """Settings of the controller's program: the load on the flange (kg, mm from it), and its limits of motion.

    `reach_mm`: distance from the flange to the farthest point of what it carries, whose speed limits turning.
    `world_box_mm`: lowest and highest corner of the goals' box, in the world frame.
    """

    load_kg: float
    load_centre_mm: tuple[float, float, float]
    reach_mm: float
    speed_max_mm_s: float
    joint_travel_deg: float
    world_box_mm: tuple[tuple[float, float, float], tuple[float, float, float]]


@runtime_checkable
class ConfiguredRobot(Protocol):
    """A robot whose program tells its settings, moves axes, and switches outputs."""

    async def read_setup(self) -> RobotSetup: ...

    async def move_to_joints(self, goal: JointGoal) -> None:
        """Move all axes to their angles; otherwise as `Robot.move_to`."""
        ...

    async def switch_output(self, output: Literal["light", "trigger"], on: bool) -> None:
        """Switch an output that the controller's settings name. Raises RequestRefused when they name none."""
        ...


class RobotCapabilities(NamedTuple):
    """What a robot can do, and how its controller gives poses.

    `moves` False for a robot that is only read: arming raises RequestRefused, moving MoveRefused.
    `pose_convention`: frames, unit and quaternion order at the controller, for messages. `pose_frame`: the frame in
    which the controller gives and takes poses of the flange.
    """

    moves: bool
    pose_convention: str
    pose_frame: Literal["base", "world"] = "base"


class Robot(Device, Protocol):
    """An arm with its controller, disarmed after every (re)connection; an interrupted move is never repeated."""

    @property
    def capabilities(self) -> RobotCapabilities: ...

    async def read_pose(self) -> PoseReading: ...

    async def read_joints(self) -> Array:
        """Angles of the arm's axes (6,) or (7,) in rad."""
        ...

    async def read_status(self) -> RobotStatus: ...

    async def set_armed(self, armed: bool) -> None: ...

    async def move_to(self, goal: MoveGoal) -> None:
        """Move; returns when the arm stands at the goal, otherwise raises a DeviceError. Cancelling stops the arm."""
        ...

    async def stop_and_disarm(self) -> None:
        """Stop and disarm now, before every other request; returns when the controller has accepted both.

        `read_standstill` then reports whether they have taken effect.
        """
        ...

    async def read_standstill(self) -> Standstill:
        """Whether the arm stands and is disarmed, asked before every other request but a stop."""
        ...


@dataclass(frozen=True)
class Vibration:
    """Deviation of the flange from its mean within a window. `lost`: samples sent but not received."""

    translation_mm: float
    rotation_rad: float
    samples: int
    lost: int


class VibrationMonitor(Protocol):
    """A stream of flange poses beside the robot, fast enough to show vibration."""

    def vibration(self, window_s: float) -> Vibration:
        """Vibration within the last `window_s`. Raises DeviceTimeout when the controller sends nothing."""
        ...

    def close(self) -> None: ...


@dataclass(frozen=True)
class CaptureSettings:
    """What a camera reports of a frame: bits of its grey levels, exposure, gain, temperature, time of its own clock.

    None: it does not report that.
    """

    bits: int = 8
    pixel_format: str | None = None
    exposure_us: float | None = None
    gain_db: float | None = None
    temperature_c: float | None = None
    device_time_ns: int | None = None


@dataclass(frozen=True, eq=False)
class CameraFrame:
    """An image: uint8 (h, w) grey or (h, w, 3) BGR. `encoded`: the file it was decoded from, if any.

    Of more than 8 bits `image` holds the full range scaled to 8, and `levels` the camera's own, or `encoded` every bit.
    `capture` None: not known.
    """

    image: NDArray[np.uint8]
    taken_at_s: float
    encoded: bytes | None = None
    capture: CaptureSettings | None = None
    levels: NDArray[np.uint16] | None = None


class Camera(Device, Protocol):
    """A camera on the flange."""

    async def grab(self, newer_than_s: float) -> CameraFrame:
        """A frame exposed after `newer_than_s`; raises a DeviceError on timeout."""
        ...


@runtime_checkable
class PreviewCamera(Protocol):
    """A camera that also sends smaller pictures, for screens."""

    async def preview(self, newer_than_s: float, width: int) -> CameraFrame:
        """As `grab`, about `width` px wide where the camera scales pictures."""
        ...


@dataclass(frozen=True)
class Exposure:
    """Exposure time in microseconds and gain in dB."""

    exposure_us: float
    gain_db: float = 0.0


@dataclass(frozen=True)
class ExposureRange:
    """What a camera can set, ends included. `gain_db` (0, 0): gain that cannot be set in dB."""

    exposure_us: tuple[float, float]
    gain_db: tuple[float, float] = (0.0, 0.0)


@runtime_checkable
class AdjustableCamera(Protocol):
    """A camera whose exposure time and gain can be set."""

    async def read_exposure(self) -> tuple[Exposure, ExposureRange] | None:
        """What is set and what can be; None for a camera that does not have the setting. Raises DeviceError."""
        ...

    async def set_exposure(self, wanted: Exposure) -> Exposure:
        """Set both, for frames exposed from now on; returns what the camera made of it. Raises DeviceError."""
        ...


@dataclass(frozen=True)
class DeviceIdentity:
    """Who a device is and what it can do: `abilities` are short phrases for people."""

    vendor: str
    model: str
    serial: str
    address: str
    abilities: tuple[str, ...] = ()


@runtime_checkable
class IdentifiedDevice(Protocol):
    """A device that reports who it is."""

    async def identify(self) -> DeviceIdentity:
        """Raises DeviceError."""
        ...


@dataclass(frozen=True)
class ScannedCloud:
    """A cloud in the scanner frame, as the file received."""

    content: bytes
    media_type: Literal["application/x-ply", "application/x-pcd"]
    taken_at_s: float


class Scanner(Device, Protocol):
    """A 3D scanner on the flange."""

    async def scan(self, newer_than_s: float) -> ScannedCloud:
        """A cloud captured after `newer_than_s`; raises a DeviceError on timeout."""
        ...


class PathRecorder(Protocol):
    """Reads the flange's poses along its path."""

    async def read(self) -> tuple[Array, Array]:
        """Times (n,) of the driver's clock and flange poses (n, 4, 4) since the last call. Raises DeviceError."""
        ...


@runtime_checkable
class ProfileSource(Protocol):
    """A scanner that measures one line at a time, while the arm moves.

    `lag_s`: how long after it was taken a profile may still come. `lost_profiles`: taken and not sent, if it counts.
    """

    lag_s: float
    lost_profiles: int

    def profiles(self) -> "AsyncIterator[ProfileBlock]":
        """Profiles in their order, from now on; their times are those of the driver's clock. Ends with DeviceError."""
        ...


class MakeRobot(Protocol):
    """Constructor of a robot driver. `source`: the address as parsed by its scheme's entry in the registry.

    A controller that does not answer for `limit_s` is disconnected; None: the driver's own limit. `axes`: of the arm,
    6 or 7.
    """

    def __call__(self, source: Any, timing: Timing, /, *, limit_s: float | None = None, axes: int = 6) -> Robot: ...


class MakeCamera(Protocol):
    """Constructor of a camera driver; `source` as for a robot.

    A frame of another size than `image_size` (width, height) is refused with GarbledAnswer; None allows any.
    `limit_s`: how long `grab` waits after `newer_than_s`.
    """

    def __call__(
        self, source: Any, timing: Timing, /, *, image_size: tuple[int, int] | None, limit_s: float
    ) -> Camera: ...


class MakeScanner(Protocol):
    """Constructor of a scanner driver; `source` as for a robot, `limit_s` as for a camera.

    A cloud of more bytes than the driver takes, 1 GiB, is refused with AnswerTooLarge.
    """

    def __call__(self, source: Any, timing: Timing, /, *, limit_s: float) -> Scanner: ...
