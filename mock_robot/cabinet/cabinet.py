"""Base class of a controller cabinet: arm, switches, event log and time, independent of the robot program.

Times are passed in. `now_s` is wire time (heartbeat, time stamps); the arm runs `time_scale` times faster.
"""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np

from calibration.kinematics.external_axis import AxisKind, ExternalAxis, reading_of
from calibration.kinematics.seven_axes import SevenAxisArm
from calibration.transforms import Array, inverse, transform
from mock_robot.arm.simulated_arm import SimulatedArm
from mock_robot.cabinet.disk import Disk
from mock_robot.cabinet.panel import Mode, Panel
from protocols.cb import messages as cb
from protocols.cb.codes import Flag, Status

TITLES: Mapping[int, str] = MappingProxyType(
    {
        10020: "Execution error state",
        50026: "Close to singularity",
        50027: "Joint Out of Range",
        50050: "Position outside reach",
        50080: "Position not compatible",
    }
)
"""Titles by number."""


UP, LEFT = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])
BESIDE: dict[AxisKind, ExternalAxis] = {
    "track": ExternalAxis("track", 1, LEFT, np.zeros(3)),
    "turntable": ExternalAxis("turntable", 1, UP, np.array([1000.0, 150.0, 0.0])),
}
"""As drawn: what `handeyed mock run --beside` puts beside the arm."""
OFF = np.array([*np.radians([0.3, -0.2]), 12.0, -8.0])
"""Of that axis as built from the one as drawn: two turns of its direction, two shifts of its point in mm."""


@dataclass
class Mounting:
    """Base frame (4, 4) in the world, mm, as MOC's base_frame_pos and _orient.

    `track`: direction in the world of a track that the first external axis (mm) moves the base along; None without
    one. `integrated`: the controller knows it (base_frame_coordinated) and reports poses that include it; otherwise
    only the arm moves with it, and the reported pose does not. `beside`: a track or turntable as built, that the
    controller leaves out of its poses.
    """

    world_T_base: Array = field(default_factory=lambda: np.eye(4))
    track: tuple[float, float, float] | None = None
    integrated: bool = True
    beside: ExternalAxis | None = None

    @classmethod
    def with_axis(cls, kind: AxisKind | None) -> "Mounting":
        """A base with this axis beside it, which is built a little off its drawing; or with none."""
        return cls(beside=BESIDE[kind].apply_step(OFF) if kind else None)

    def document(self, drawn: bool) -> dict[str, Any]:
        """The axis beside the arm as [robot.external_axis] has it, as drawn or as built; nothing without one."""
        if self.beside is None:
            return {}
        axis = BESIDE[self.beside.kind] if drawn else self.beside
        point_mm = {} if axis.kind == "track" else {"point_mm": axis.point_mm.tolist()}
        held = {"kind": axis.kind, "number": axis.number, "direction": axis.direction.tolist(), **point_mm}
        return {"external_axis": held}

    def axes_at(self, reading: float) -> tuple[float, ...]:
        """The controller's external axes with the one beside the arm there, in mm or degrees, and no others."""
        number = 0 if self.beside is None else self.beside.number
        return tuple(reading if each == number else UNUSED_AXIS for each in range(1, 7))

    def reported_world_T_base(self, external_axes: tuple[float, ...]) -> Array:
        """Where the controller believes it to stand."""
        return self._moved(external_axes) if self.integrated else self.world_T_base

    def start_T_base(self, external_axes: tuple[float, ...]) -> Array:
        """The base now, where the track is at 0 and as a turntable sees it: what camera and target see."""
        start_T_base = inverse(self.world_T_base) @ self._moved(external_axes)
        if self.beside is None:
            return start_T_base
        reading = reading_of(self.beside.kind, external_axes[self.beside.number - 1])
        moved: Array = self.beside.motion(reading) @ start_T_base
        return moved

    def _moved(self, external_axes: tuple[float, ...]) -> Array:
        if self.track is None or external_axes[0] >= 8.9e9:
            return self.world_T_base
        return transform(np.eye(3), external_axes[0] * np.array(self.track)) @ self.world_T_base


MANUAL_SPEED_MM_S = 250.0
"""Manual reduced speed: faster moves are limited to it."""
UNUSED_AXIS = 9e9
MIN_OVERRIDE = 1e-6


@dataclass(frozen=True)
class MotionBox:
    """Allowed volume of the flange, mm in the world frame; the robot program checks it."""

    low_mm: tuple[float, float, float] = (-1600.0, -1600.0, 0.0)
    high_mm: tuple[float, float, float] = (1600.0, 1600.0, 2200.0)

    def contains(self, point_mm: Array) -> bool:
        return bool(np.all(point_mm >= self.low_mm) and np.all(point_mm <= self.high_mm))


@dataclass(frozen=True)
class LogEntry:
    """A line of the controller's event log; `code` is ABB's number, 0 where there is none."""

    at_s: float
    code: int
    text: str


class CabinetSymbol(Protocol):
    """A RAPID persistent: its type, and its value in RAPID syntax. Setting a value may raise ValueError."""

    @property
    def type(self) -> str: ...

    value: str


@dataclass
class Cabinet(ABC):
    """Switches and state of a controller. The robot program behind the link is implemented by a subclass."""

    arm: SimulatedArm
    session: int
    time_scale: float = 1.0
    started_at_s: float = 0.0
    box: MotionBox = field(default_factory=MotionBox)
    panel: Panel = field(default_factory=Panel)
    external_axes: tuple[float, ...] = (UNUSED_AXIS,) * 6
    settles: bool = True
    mounting: Mounting = field(default_factory=Mounting)
    disk: Disk = field(default_factory=Disk)
    armed: bool = field(default=False, init=False)
    moves_accepted: int = field(default=0, init=False)
    log: deque[LogEntry] = field(default_factory=lambda: deque(maxlen=1000), init=False)
    recorded: int = field(default=0, init=False)

    def robot_s(self, now_s: float) -> float:
        """Time on the arm's own clock."""
        return (now_s - self.started_at_s) * self.time_scale

    @property
    def world_T_base(self) -> Array:
        """Base frame (4, 4) by which the controller reports poses now."""
        return self.mounting.reported_world_T_base(self.external_axes)

    def robtarget_axes(self, robot_s: float) -> tuple[float, ...]:
        """External axes as of a robtarget: the arm angle in degrees first, for an arm with seven axes."""
        arm = self.arm.arm
        if not isinstance(arm, SevenAxisArm):
            return self.external_axes
        return float(np.degrees(arm.arm_angle_rad(self.arm.joints_at(robot_s)))), *self.external_axes[1:]

    def jointtarget_axes(self, robot_s: float) -> tuple[float, ...]:
        """External axes as of a jointtarget: axis 7 in degrees first, for an arm with seven axes."""
        if not isinstance(self.arm.arm, SevenAxisArm):
            return self.external_axes
        return float(np.degrees(self.arm.joints_at(robot_s)[6])), *self.external_axes[1:]

    @abstractmethod
    def tick(self, now_s: float) -> list[cb.Success]:
        """Advance to `now_s`; returns messages to announce without a request."""

    @abstractmethod
    def halt(self, now_s: float, result: Status) -> None:
        """Stop and disarm."""

    @abstractmethod
    def restart(self, now_s: float) -> None:
        """Warm start: new session, disarmed, program state cleared."""

    def fail_power(self, now_s: float) -> None:
        """A power failure and the start after it; motors and program are then started by hand."""
        self.restart(now_s)
        self.switch_motors(False, now_s)
        self.run_program(False, now_s)

    def move_pointer_to_main(self, now_s: float) -> None:
        """PP to main at the pendant; the program must be stopped."""
        self.record(now_s, 0, "program pointer set to main")

    def symbol(self, task: str, module: str, name: str) -> "CabinetSymbol | None":
        """A PERS of the program, by names in lower case; None for a program that has no RAPID."""
        return None

    def program(self) -> dict[str, tuple[bool, dict[str, str]]]:
        """Tasks of a program in RAPID: whether each moves the arm, and the kinds of its modules by name."""
        return {}

    def signals_now(self) -> dict[str, tuple[str, str, bool, float]]:
        """A program's signals by name: kind, device, whether a remote client may write it, value."""
        return {}

    def stand_axes(self, external_axes: tuple[float, ...]) -> None:
        """The external axes stand there now, as moved at the pendant."""
        self.external_axes = external_axes

    def set_signal(self, name: str, value: float) -> bool:
        """Set a program's signal; returns whether there is one of that name."""
        return False

    # --- switches, operated by people, tests and faults ---

    def switch_motors(self, on: bool, now_s: float) -> None:
        """Switch the motors on or off; they stay off while the emergency stop is pressed."""
        self.panel.motors_on = on and not self.panel.emergency_stop
        self.record(now_s, 10011 if self.panel.motors_on else 10012, f"motors {'on' if on else 'off'}")
        self.apply_panel(now_s)

    def switch_mode(self, mode: Mode, now_s: float) -> None:
        """Turn the mode switch: motion stops, and the client must arm again."""
        changed, self.panel.mode = mode is not self.panel.mode, mode
        self.record(now_s, 10015 if mode is not Mode.AUTO else 10017, f"mode {mode.value}")
        if changed:
            self.halt(now_s, Status.WRONG_MODE)

    def press_emergency_stop(self, pressed: bool, now_s: float) -> None:
        """Press or release the emergency stop; pressing cuts the motors' power, releasing does not restore it."""
        self.panel.emergency_stop = pressed
        if pressed:
            self.panel.motors_on = False
        self.record(now_s, 10013 if pressed else 10014, f"emergency stop {'pressed' if pressed else 'released'}")
        self.apply_panel(now_s)

    def run_program(self, running: bool, now_s: float) -> None:
        """Start or stop the motion task's program."""
        self.panel.program_running = running
        self.record(now_s, 10002 if running else 10005, f"program {'started' if running else 'stopped'}")
        self.apply_panel(now_s)

    def recover(self, now_s: float) -> None:
        """Recover as an operator does after a stop: automatic mode, motors on, program started."""
        if self.panel.mode is not Mode.AUTO:
            self.switch_mode(Mode.AUTO, now_s)
        self.switch_motors(True, now_s)
        self.run_program(True, now_s)

    def apply_panel(self, now_s: float) -> None:
        """React to a turned switch: end whatever its position forbids."""
        forbidden = self.panel.forbids_motion()
        if forbidden is not None:
            self.halt(now_s, forbidden)

    def record(self, now_s: float, code: int, text: str) -> None:
        """Append a line to the event log."""
        self.log.append(LogEntry(now_s, code, text))
        self.recorded += 1

    def flags(self, now_s: float) -> Flag:
        """Controller state as the link's 16 flags."""
        robot_s, panel = self.robot_s(now_s), self.panel
        switches = {
            Flag.MOTORS_ON: panel.motors_on,
            Flag.AUTO: panel.mode is Mode.AUTO,
            Flag.ESTOP: panel.emergency_stop,
            Flag.MOVING: self.arm.is_moving_at(robot_s),
            Flag.IN_POSITION: self.settles and self.arm.is_settled_at(robot_s),
            Flag.ARMED: self.armed,
            Flag.TASK_RUNNING: panel.program_running,
            Flag.SPEED_LIMITED: panel.mode is not Mode.AUTO or panel.speed_override < 1.0,
        }
        return Flag(sum(flag for flag, on in switches.items() if on))
