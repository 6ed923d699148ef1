"""The cell: its devices, exclusive access to the arm, and what keeps it from working."""

import asyncio
import logging
from collections.abc import AsyncIterator, Iterable, Mapping
from contextlib import asynccontextmanager
from copy import copy
from dataclasses import dataclass, field, replace
from functools import partial
from hashlib import blake2b
from typing import TYPE_CHECKING, Literal

import numpy as np

from calibration.sentences.sentence import Sentence, as_sentence, is_known
from calibration.transforms import Array, difference, inverse
from daemon.cell.arm_in_cell import ArmInCell
from daemon.cell.capture_outputs import CaptureOutputs
from daemon.cell.held_button import HeldButton
from daemon.cell.safe_stop import SafeStop
from daemon.cell.settling import VibrationGate, check_external_axes, check_still, read_if_standing, settle
from daemon.config.robot_settings import SettlingSettings
from daemon.config.settings import MAIN_CAMERA, MAIN_SCANNER
from daemon.errors import CellBusy, CellNotReady, InterlockOpen, NoScanner, StaleCaptureError
from daemon.runtime.clock import Clock
from daemon.runtime.event_bus import Publish
from daemon.runtime.failpoints import NO_FAILPOINTS, Failpoints
from drivers.errors import DeviceError, errors_of
from drivers.interfaces import (
    Camera,
    CameraFrame,
    JointGoal,
    MoveGoal,
    PathRecorder,
    PoseReading,
    PreviewCamera,
    Robot,
    RobotStatus,
    ScannedCloud,
    Scanner,
)
from drivers.interlocked_robot import InterlockedRobot
from drivers.registry import record_path
from drivers.robots.base_frame import configured

if TYPE_CHECKING:
    from daemon.cell.exposure_control import ExposureControl
    from drivers.interlocks import Interlocks

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
            self.check(np.ascontiguousarray(frame.image).data, "picture", reading)

    def check(self, content: "bytes | memoryview", kind: Literal["picture", "cloud"], reading: PoseReading) -> None:
        """Raises StaleCaptureError for repeated content."""
        digest, before = blake2b(content, digest_size=16).digest(), self._base_T_flange
        same, self._digest = digest == self._digest, digest
        self._base_T_flange = reading.base_T_flange
        if not same or before is None:
            return
        apart_mm, apart_rad = difference(before, reading.base_T_flange)
        if apart_mm > MIN_DISTANCE_MM or apart_rad > MIN_ROTATION_RAD:
            device = _device_words(self.device)
            what = Sentence(f"same-{kind}-again", device=device, apart_mm=apart_mm)
            raise StaleCaptureError(what, Sentence("take-anew-each-time", device=device))


class CameraTurns:
    """Grabs one frame at a time; a run waits for one reader's grab at most.

    That grab is not cut off: a camera goes on with a picture that nobody waits for, and the run's would time out.
    """

    def __init__(self, camera: Camera, clock: Clock) -> None:
        self._camera, self._clock = camera, clock
        self._turn = asyncio.Lock()
        self._runs = 0
        self.newest: tuple[int, CameraFrame | None] = 0, None
        """Number and frame of the last grab, of a run or for screens."""

    async def grab(self, newer_than_s: float) -> CameraFrame:
        """A frame exposed after `newer_than_s`, for a run. Raises DeviceError."""
        self._runs += 1
        try:
            async with self._turn:
                with errors_of("camera"):
                    frame = await self._camera.grab(newer_than_s)
                self.newest = self.newest[0] + 1, frame
                return frame
        finally:
            self._runs -= 1

    async def read(self) -> CameraFrame:
        """A frame exposed after this call, or the one that a run grabs meanwhile. Raises DeviceError."""
        shares_run, before = self._runs > 0, self.newest[0]
        asked_at_s = self._clock.monotonic_s()
        async with self._turn:
            number, frame = self.newest
            if shares_run and frame is not None and number > before:
                return frame
            with errors_of("camera"):
                return await self._camera.grab(asked_at_s)

    async def preview(self, width: int) -> None:
        """Make `newest` a frame of now, `width` px wide where the camera can; that of a run, if one grabs meanwhile.

        Raises DeviceError.
        """
        async with self._turn:
            if self._runs == 0:
                now_s, camera = self._clock.monotonic_s(), self._camera
                with errors_of("camera"):
                    if isinstance(camera, PreviewCamera):
                        frame = await camera.preview(now_s, width)
                    else:
                        frame = await camera.grab(now_s)
                self.newest = self.newest[0] + 1, frame


MAX_ROUND_TRIP_S = 0.05
"""A pose whose answer took longer was taken at a time that is too uncertain, and is left out."""


class PolledPath:
    """drivers.interfaces.PathRecorder of a robot that answers when asked: a pose is taken midway of its round trip."""

    def __init__(self, robot: Robot, clock: Clock) -> None:
        self._robot, self._clock, self._last_s = robot, clock, -np.inf

    async def read(self) -> tuple[Array, Array]:
        """One pose; none when its answer came late, or where the clock has not moved on. Raises DeviceError."""
        reading = await self._robot.read_pose()
        took_s = self._clock.monotonic_s() - reading.taken_at_s
        time_s = reading.taken_at_s + took_s / 2
        if took_s > MAX_ROUND_TRIP_S or time_s <= self._last_s:
            return np.empty(0), np.empty((0, 4, 4))
        self._last_s = time_s
        return np.array([time_s]), reading.base_T_flange[None]


class PathInBase:
    """A recorder whose poses are in the world frame, moved to the base frame."""

    def __init__(self, recorder: PathRecorder, world_T_base: Array) -> None:
        self._recorder, self._base_T_world = recorder, inverse(world_T_base)

    async def read(self) -> tuple[Array, Array]:
        times_s, world_T_flange = await self._recorder.read()
        return times_s, self._base_T_world @ world_T_flange


log = logging.getLogger(__name__)

MAX_STATUS_S = 1.0
"""A controller normally answers a status request within milliseconds."""

POLL_S = 0.02

READ_ONLY = Sentence("read-only-link")

NO_SCANNER = (NoScanner().what,)

AXES_NOT_MOVED = Sentence("axes-over-cb-link")


@dataclass(frozen=True)
class Devices:
    """The devices of a cell. `cameras` and `scanners`: further ones, by name."""

    robot: Robot
    camera: Camera
    scanner: Scanner | None
    vibration_gate: VibrationGate | None = None
    outputs: CaptureOutputs | None = None
    cameras: Mapping[str, Camera] = field(default_factory=dict)
    scanners: Mapping[str, Scanner] = field(default_factory=dict)


@dataclass
class Occupancy:
    """Who holds the cell, shared by the views of it through each camera.

    `obstacles_seen`: how often an obstacle to motion was found, whoever asked; `last_obstacle`: the first of the last.
    """

    holder: str | None = None
    external_axes: tuple[float, ...] | None = None
    leased: bool = False
    obstacles_seen: int = 0
    last_obstacle: str = ""


class Cell:
    """Owns the devices. One holder at a time; the arm is armed only under a motion lease.

    Pictures are of [camera]; `seen_by` gives the same cell with another camera.
    """

    def __init__(
        self,
        devices: Devices,
        settling: SettlingSettings,
        clock: Clock,
        interlocks: "Interlocks | None" = None,
        at: Failpoints = NO_FAILPOINTS,
        publish: Publish = lambda kind, data: None,
        exposure: "ExposureControl | None" = None,
        world_T_base: Array | None = None,
        arm: ArmInCell | None = None,
    ) -> None:
        self.arm = arm or ArmInCell()
        self.robot: Robot = InterlockedRobot(devices.robot, interlocks) if interlocks else devices.robot
        self._interlocks = interlocks
        self._devices, self._vibration_gate = devices, devices.vibration_gate
        self._outputs, self._world_T_base = devices.outputs, world_T_base
        self._settling, self._clock, self._at, self.exposure = settling, clock, at, exposure
        self.occupancy = Occupancy()
        self.buttons: dict[str, HeldButton] = {}  # that a motion in progress lasts for, by their names
        self.safe_stop = SafeStop(self.robot, clock, lambda: self.occupancy.leased, publish)
        self._look_through(MAIN_CAMERA, devices.camera)
        main = {} if devices.scanner is None else {MAIN_SCANNER: devices.scanner}
        self._scanners = {
            name: (scanner, StaleCaptureDetector(name)) for name, scanner in {**main, **devices.scanners}.items()
        }

    def _look_through(self, name: str, camera: Camera) -> None:
        self._camera_name, self.camera = name, camera
        self.camera_turns = CameraTurns(camera, self._clock)
        self._camera_staleness = StaleCaptureDetector(name)

    def seen_by(self, name: str, exposure: "ExposureControl | None") -> "Cell":
        """The same cell, with the same holder, through another of its cameras."""
        view = copy(self)
        view.exposure = exposure
        view._look_through(name, self._devices.cameras[name])
        return view

    @property
    def holder(self) -> str | None:
        return self.occupancy.holder

    @asynccontextmanager
    async def hold(self, holder: str) -> AsyncIterator["Cell"]:
        """Hold the cell without moving the arm until the block ends. Never waits. Raises CellBusy."""
        if self.holder is not None:
            raise CellBusy(self.holder)
        self.occupancy.holder, self.occupancy.external_axes = holder, None
        try:
            yield self
        finally:
            self.occupancy.holder = None

    @asynccontextmanager
    async def motion_lease(self, holder: str) -> AsyncIterator[Robot]:
        """Hold the cell and arm the robot until the block ends; then it is stopped and disarmed in every case.

        A stop that is not confirmed within MAX_ATTEMPT_S goes on, and nobody gets the lease before it is confirmed.
        Raises CellBusy, CellNotReady, DeviceError.
        """
        async with self.hold(holder), self.armed() as robot:
            yield robot

    @asynccontextmanager
    async def armed(self) -> AsyncIterator[Robot]:
        """Arm the robot, for the holder, until the block ends; as `motion_lease`. Raises CellNotReady, DeviceError."""
        assert self.holder is not None
        if not self.robot.capabilities.moves:  # nor stopped at the end: the program that runs is somebody else's
            raise CellNotReady((READ_ONLY,))
        reasons = (*self._stop_obstacle(), *motion_obstacles(await self.robot.read_status()))
        if reasons:
            raise CellNotReady(reasons)
        self.occupancy.leased = True
        try:
            await self.robot.set_armed(True)
            yield self.robot
        finally:
            self.occupancy.leased = False
            await self.safe_stop.stop_and_disarm()

    def stop_motion(self) -> None:
        """Begin to stop and disarm the arm at once when somebody has a motion lease; its holder waits for the end."""
        if self.occupancy.leased:
            self.safe_stop.begin()

    async def move_to(self, goal: MoveGoal) -> None:
        """Move the arm, under a motion lease; returns when it has arrived. Raises DeviceError."""
        self._at("before move")
        await self.robot.move_to(goal)
        self._at("after move")

    async def move_to_joints(self, goal: JointGoal) -> None:
        """Move the axes, under a motion lease; returns when the arm has arrived. Raises CellNotReady, DeviceError."""
        self._at("before move")
        program = configured(self.robot)
        if program is None:
            raise CellNotReady((AXES_NOT_MOVED,))
        await self.require_interlocks()
        await program.move_to_joints(goal)
        self._at("after move")

    async def read_settled_pose(self) -> PoseReading:
        """Pose and joints of the arm, once it is at rest and no longer vibrates. Raises NotStill, DeviceError."""
        if self._vibration_gate is not None:
            await self._vibration_gate.wait(self._settling.limit_s, self._clock)
        return await self._with_joints(self._on_the_same_base(await settle(self.robot, self._settling, self._clock)))

    async def read_standing_pose(self) -> PoseReading:
        """Pose and joints of an arm that an operator moves, if it is at rest now. Raises NotStill, DeviceError."""
        if self._vibration_gate is not None:
            self._vibration_gate.check()
        standing = await read_if_standing(self.robot, self._settling, self._clock)
        return await self._with_joints(self._on_the_same_base(standing))

    async def _with_joints(self, reading: PoseReading) -> PoseReading:
        return replace(reading, joints_rad=await self.robot.read_joints())

    def _on_the_same_base(self, reading: PoseReading) -> PoseReading:
        """The reading, when external axes stand where they stood at the holder's first one, but for the declared one.

        Raises NotStill, CellNotReady.
        """
        if self.holder is not None:
            self.occupancy.external_axes = self.occupancy.external_axes or reading.external_axes
            check_external_axes(self.occupancy.external_axes, reading.external_axes, self.arm.declared)
        return reading

    async def capture_frame(self, before: PoseReading) -> CameraFrame:
        """Take a frame after the reading `before`, well exposed, and check that the arm has not moved since.

        Raises NotStill, StaleCaptureError, DeviceError.
        """
        self._at("before capture")
        grab = self.camera_turns.grab
        take = partial(self._outputs.capture, grab) if self._outputs else grab
        newer_than_s = before.taken_at_s
        frame = await (self.exposure.expose(take, newer_than_s) if self.exposure else take(newer_than_s))
        self._at("after capture")
        check_still(before, await self.robot.read_pose(), self._settling)
        self._camera_staleness.check_frame(frame, before)
        return frame

    async def capture_cloud(self, before: PoseReading, scanner: str = MAIN_SCANNER) -> ScannedCloud:
        """Take a cloud after the reading `before`, and check that the arm has not moved since.

        Raises NoScanner, NotStill, StaleCaptureError, DeviceError.
        """
        if scanner not in self._scanners:
            raise NoScanner
        device, staleness = self._scanners[scanner]
        self._at("before capture")
        with errors_of("scanner"):
            cloud = await device.scan(before.taken_at_s)
        self._at("after capture")
        check_still(before, await self.robot.read_pose(), self._settling)
        staleness.check(cloud.content, "cloud", before)
        return cloud

    async def record_path(self) -> PathRecorder:
        """The flange's path in base from now on: of EGM where the cell has it, else of readings. Raises DeviceError."""
        gate = self._vibration_gate
        streamed = None if gate is None else record_path(gate.monitor)
        if streamed is None:
            return PolledPath(self.robot, self._clock)
        return streamed if self._world_T_base is None else PathInBase(streamed, self._world_T_base)

    async def obstacles(self) -> tuple[str, ...]:
        """Reasons why a run with robot and camera could not start now; empty when it could."""
        return (*await self.robot_obstacles(), *_link_obstacle(self._camera_name, self.camera))

    def capture_obstacles(self) -> tuple[str, ...]:
        """Reasons why poses and pictures could not be read now, for runs that do not move the arm."""
        return (*_link_obstacle("robot", self.robot), *_link_obstacle(self._camera_name, self.camera))

    async def robot_obstacles(self) -> tuple[str, ...]:
        """Reasons why the robot could not be moved now: a stop that is not confirmed, controller and interlocks.

        Whoever asks, each answer with a reason is counted in `occupancy.obstacles_seen`, with its first.
        """
        reasons = (
            *self._stop_obstacle(),
            *await self._controller_obstacles(),
            *(await self._interlock_obstacles()).values(),
        )
        if reasons:
            self.occupancy.obstacles_seen += 1
            self.occupancy.last_obstacle = reasons[0]
        return reasons

    async def require_interlocks(self) -> None:
        """Raises InterlockOpen with the names of interlocks that do not allow motion."""
        obstacles = await self._interlock_obstacles()
        if obstacles:
            raise InterlockOpen(tuple(obstacles), tuple(obstacles.values()))

    def _stop_obstacle(self) -> tuple[str, ...]:
        unconfirmed = self.safe_stop.unconfirmed
        return () if unconfirmed is None else (_of_device("robot", unconfirmed.warning),)

    async def _controller_obstacles(self) -> tuple[str, ...]:
        try:
            async with asyncio.timeout(MAX_STATUS_S):
                obstacles = motion_obstacles(await self.robot.read_status())
                return tuple(_of_device("robot", obstacle) for obstacle in obstacles)
        except TimeoutError:
            return (_of_device("robot", Sentence("status-unanswered")),)
        except DeviceError as error:
            return (str(error),)

    async def _interlock_obstacles(self) -> dict[str, str]:
        """The reason for each interlock that does not allow motion, by its name."""
        readings = await self._interlocks.readings() if self._interlocks else ()
        return {
            reading.name: Sentence("interlock-not-allowing", name=reading.name, why=reading.why)
            for reading in readings
            if not reading.allows
        }

    def sensor_obstacles(self, names: Iterable[str]) -> tuple[str, ...]:
        """Reasons why the cameras and scanners of these names could not look now."""
        links = self.links()
        return tuple(
            reason for name in names for reason in (_link_obstacle(name, links[name]) if name in links else NO_SCANNER)
        )

    def links(self) -> dict[str, Robot | Camera | Scanner]:
        """All devices by their names in the settings."""
        scanners = {name: scanner for name, (scanner, _) in self._scanners.items()}
        return {"robot": self.robot, MAIN_CAMERA: self._devices.camera, **self._devices.cameras, **scanners}

    async def wait_for_links(self, limit_s: float) -> None:
        """Wait up to `limit_s` until every device is connected; a warning is logged for each that is not."""
        ends_s = self._clock.monotonic_s() + limit_s
        while self._clock.monotonic_s() < ends_s:
            if all(device.link.connected for device in self.links().values()):
                return
            await self._clock.sleep(POLL_S)
        for name, device in self.links().items():
            if not device.link.connected:
                log.warning("%s: %s", name, device.link.detail)

    async def close(self) -> None:
        """Close every device, also when closing one fails."""
        if self._vibration_gate is not None:
            await self._vibration_gate.close()
        for name, device in self.links().items():
            try:
                await device.close()
            except (DeviceError, OSError) as error:
                log.warning("closing the %s: %s", name, error)


def motion_obstacles(status: RobotStatus) -> tuple[Sentence, ...]:
    """Reasons why a controller in this status would not move the arm, such as "motors are off"."""
    checks = (
        (status.emergency_stop, "emergency-stop-pressed"),
        (not status.motors_on, "motors-off"),
        (not status.automatic, "not-automatic"),
        (not status.program_running, "program-not-running"),
        (status.moving, "arm-moving"),
    )
    return tuple(Sentence(reason) for hit, reason in checks if hit)


def _link_obstacle(name: str, device: Robot | Camera | Scanner) -> tuple[str, ...]:
    return () if device.link.connected else (_of_device(name, device.link.detail),)


def _of_device(name: str, detail: str) -> Sentence:
    return Sentence("of-device", device=_device_words(name), detail=as_sentence(detail))


def _device_words(device: str) -> str:
    """A device in words; a further camera or scanner has the name that the settings give it."""
    return Sentence(f"device-{device}") if is_known(f"device-{device}") else device
