"""The robot program behind the CB link in Python: executes requests, for any transport.

Times are passed in. `now_s` is wire time (heartbeat, time stamps); the arm runs `time_scale` times faster.
"""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np

from calibration.errors import GeometryError
from calibration.kinematics.arm import Arm, OtherConfiguration, UnreachablePoseError
from calibration.kinematics.seven_axes import AnyArm, SevenAxisArm
from calibration.transforms import (
    Array,
    inverse,
    quaternion_from_rotation,
    rotation_angle_rad,
    transform_from_quaternion,
)
from mock_robot.arm.simulated_arm import IN_POSITION_S
from mock_robot.cabinet.cabinet import MANUAL_SPEED_MM_S, MIN_OVERRIDE, TITLES, Cabinet
from mock_robot.cabinet.panel import Mode
from protocols.cb import messages as cb
from protocols.cb.codes import VERSION, Capability, MoveKind, Output, Status

HEARTBEAT_S = 2.0
"""Silence of the client after which the arm stops and disarms."""
MAX_SPEED_MM_S = 1000.0
"""Faster moves are refused; a calibration never needs such a speed."""
CAPABILITIES = Capability(255)
"""All of them."""
MIN_LOAD_KG = 0.01
"""A load below this is that of tool0, 1 gram: nothing is armed with it."""
MAX_JOINT_TRAVEL_RAD = np.radians(270.0)
REACH_MM = 400.0
"""Distance from the flange to the farthest point of camera or tool on it: cell_reach."""
CAMERA_LOAD = (1.5, (0.0, 0.0, 60.0))
"""Mass (kg) and centre (mm) of camera and bracket."""
BUILD = 1
MAX_RAWBYTES = 1024


@dataclass
class _Move:
    """The current move. `result` is what STATUS will report; None stands for OK so far."""

    seq: int
    reachable_fraction: float
    result: Status | None = None


@dataclass
class Controller(Cabinet):
    """State and behaviour of the robot program. It serves one client at a time, which `servers.py` ensures.

    `load`: mass and centre of what the flange carries; `outputs`: states of light and trigger; `interlocks`: inputs by
    name, each of which must be on.
    """

    load: tuple[float, tuple[float, float, float]] = CAMERA_LOAD
    outputs: dict[Output, bool] = field(default_factory=dict, init=False)
    interlocks: dict[str, bool] = field(default_factory=dict, init=False)
    _error: cb.ErrorText = field(default=cb.ErrorText(0, "", ""), init=False)
    _move: _Move | None = field(default=None, init=False)
    _finished: tuple[int, Status] = field(default=(0, Status.OK), init=False)
    _greeted_at_s: float = field(default=0.0, init=False)
    _heard_at_s: float | None = field(default=None, init=False)

    # --- time ---

    def tick(self, now_s: float) -> list[cb.Success]:
        """Advance to `now_s`: heartbeat and end of the move. Returns messages to announce."""
        if self._heard_at_s is not None and now_s - self._heard_at_s >= HEARTBEAT_S:
            self._heard_at_s = None
            if self.armed or self._move is not None:
                self.record(now_s, 0, "no sign of life from the client for 2 s: stopped and disarmed")
            self.halt(now_s, Status.ABORTED)
        return [self._report(now_s)] if self._finish(now_s) else []

    def next_event_s(self, now_s: float) -> float | None:
        """Time at which `tick` has something to do, in wire time; None when nothing is pending."""
        times = [] if self._heard_at_s is None else [self._heard_at_s + HEARTBEAT_S]
        if self._move is not None and self.settles:
            settled_s = self.arm.end_s + IN_POSITION_S
            times.append(now_s + max(settled_s - self.robot_s(now_s), 0.0) / self.time_scale + 1e-4)
        return min(times, default=None)

    # --- the client ---

    def note_sign_of_life(self, now_s: float) -> None:
        self._heard_at_s = now_s

    def disconnect(self, now_s: float) -> None:
        """The client has gone: stop and disarm."""
        self._heard_at_s = None
        self.halt(now_s, Status.ABORTED)

    def answer(self, seq: int, request: cb.Request, now_s: float) -> cb.Reply:
        self.note_sign_of_life(now_s)
        self.tick(now_s)
        return _HANDLERS[type(request)](self, seq, request, now_s)

    def restart(self, now_s: float) -> None:
        self.disconnect(now_s)
        self.session = self.session % 65535 + 1
        self._move, self._finished = None, (0, Status.OK)
        self.record(now_s, 10002, "controller restarted")

    def halt(self, now_s: float, result: Status) -> None:
        self.armed = False
        self._stop(now_s, result)

    # --- requests ---

    def _hello(self, seq: int, request: cb.Hello, now_s: float) -> cb.Reply:
        self.halt(now_s, Status.ABORTED)
        self._move, self._finished = None, (0, Status.OK)
        self._greeted_at_s = now_s
        return cb.Welcome(VERSION, CAPABILITIES, self.session, BUILD, MAX_RAWBYTES, 6)

    def _pose(self, seq: int, request: cb.GetPose, now_s: float) -> cb.Reply:
        robot_s = self.robot_s(now_s)
        pose = self.world_T_base @ self.arm.reported_base_T_flange(robot_s)
        return cb.Pose(
            position_mm=float32_tuple(pose[:3, 3]),
            quaternion_wxyz=float32_tuple(quaternion_from_rotation(pose[:3, :3])),
            configuration=self.arm.arm.configuration(self.arm.joints_at(robot_s)),
            external_axes=float32_tuple(self.robtarget_axes(robot_s)),
            t_ms=self._t_ms(now_s),
            flags=self.flags(now_s),
        )

    def _joints(self, seq: int, request: cb.GetJoints, now_s: float) -> cb.Reply:
        robot_s = self.robot_s(now_s)
        axes_deg = np.degrees(self.arm.joints_at(robot_s))[:6]
        return cb.Joints(float32_tuple(axes_deg), float32_tuple(self.jointtarget_axes(robot_s)))

    def _arm(self, seq: int, request: cb.SetArmed, now_s: float) -> cb.Reply:
        if not request.armed:
            self.halt(now_s, Status.ABORTED)
            return cb.ArmingDone()
        forbidden = self._obstacle()
        if forbidden is not None:
            return self._refuse(now_s, forbidden, "arming refused")
        if request.session != self.session:
            return self._refuse(
                now_s, Status.NOT_ARMED, f"arming for session {request.session}, this is {self.session}"
            )
        self.armed = True
        return cb.ArmingDone()

    def _obstacle(self) -> Status | None:
        """Why nothing may move now: the panel, no load, an interlock."""
        forbidden = self.panel.forbids_motion()
        if forbidden is None and self.load[0] < MIN_LOAD_KG:
            return Status.NO_LOAD
        if forbidden is None and not all(self.interlocks.values()):
            return Status.INTERLOCK
        return forbidden

    def _stop_request(self, seq: int, request: cb.Stop, now_s: float) -> cb.Reply:
        self._stop(now_s, Status.ABORTED)
        return cb.Stopped()

    def _bye(self, seq: int, request: cb.Bye, now_s: float) -> cb.Reply:
        self.disconnect(now_s)
        return cb.Farewell()

    def _move_request(self, seq: int, request: cb.Move, now_s: float) -> cb.Reply:
        if refused := self._refuse_start(request.speed_mm_s, now_s):
            return refused
        if not np.all(np.isfinite([*request.position_mm, *request.quaternion_wxyz, *request.external_axes])):
            return self._refuse(now_s, Status.BAD_FIELD, "a number of the pose is not finite")
        try:
            world_T_flange = transform_from_quaternion(request.position_mm, request.quaternion_wxyz)
        except GeometryError as error:
            return self._refuse(now_s, Status.BAD_FIELD, str(error))
        if not self.box.contains(world_T_flange[:3, 3]):
            return self._refuse(now_s, Status.OUTSIDE_BOX, f"flange at {request.position_mm} mm")
        world_T_base = self.mounting.reported_world_T_base(self._external_goal(request.external_axes))
        base_T_flange = inverse(world_T_base) @ world_T_flange
        here = self.arm.joints_at(self.robot_s(now_s))
        try:
            there = goal_joints(self.arm.arm, base_T_flange, request.configuration, here, request.external_axes[0])
        except UnreachablePoseError as error:
            code = 50080 if isinstance(error, OtherConfiguration) else 50050
            return self._refuse(now_s, Status.UNREACHABLE, error.what, code)
        linear = request.kind is MoveKind.LINEAR
        return self._depart(seq, there, request.external_axes, request.speed_mm_s, linear, now_s) or cb.MoveAccepted()

    def _move_joints(self, seq: int, request: cb.MoveJoints, now_s: float) -> cb.Reply:
        if refused := self._refuse_start(request.speed_mm_s, now_s):
            return refused
        if not np.all(np.isfinite([*request.axes_deg, *request.external_axes])):
            return self._refuse(now_s, Status.BAD_FIELD, "an axis is not finite")
        seventh = request.external_axes[:1] if isinstance(self.arm.arm, SevenAxisArm) else ()
        there = np.radians([*request.axes_deg, *seventh])
        try:
            self.arm.arm.require_within_limits(there)
        except UnreachablePoseError as error:
            return self._refuse(now_s, Status.UNREACHABLE, error.what, 50027)
        if not self.box.contains((self.world_T_base @ self.arm.arm.forward(there))[:3, 3]):
            return self._refuse(now_s, Status.OUTSIDE_BOX, f"axes {request.axes_deg}")
        refused = self._depart(seq, there, request.external_axes, request.speed_mm_s, False, now_s)
        return refused or cb.JointMoveAccepted()

    def _refuse_start(self, speed_mm_s: float, now_s: float) -> cb.Refused | None:
        """Refuse a move for the state of the cell or its speed."""
        forbidden = self._obstacle()
        if forbidden is not None:
            return self._refuse(now_s, forbidden, "move refused")
        if not self.armed:
            return self._refuse(now_s, Status.NOT_ARMED, "move refused: not armed")
        if self._move is not None:
            return self._refuse(now_s, Status.BUSY, f"move {self._move.seq} is under way")
        if not 0.0 < speed_mm_s <= MAX_SPEED_MM_S:  # NaN compares false
            return self._refuse(now_s, Status.SPEED, f"speed {speed_mm_s} mm/s")
        return None

    def _depart(
        self, seq: int, there: Array, external_axes: cb.Six, speed_mm_s: float, linear: bool, now_s: float
    ) -> cb.Refused | None:
        """Start the move, with its turning limited; refuse one with too much joint travel."""
        robot_s = self.robot_s(now_s)
        here = self.arm.joints_at(robot_s)
        travel_rad = float(np.abs(there - here).max())
        if travel_rad > MAX_JOINT_TRAVEL_RAD:
            return self._refuse(now_s, Status.UNREACHABLE, f"an axis would turn by {np.degrees(travel_rad):.0f} deg")
        cap = MANUAL_SPEED_MM_S if self.panel.mode is Mode.MANR else MAX_SPEED_MM_S
        poses = self.arm.arm.forward(np.array([here, there]))
        travel, turn = speeds_sharing(poses[0], poses[1], min(speed_mm_s, cap) * (1.0 if linear else 0.8), REACH_MM)
        override = max(self.panel.speed_override, MIN_OVERRIDE)
        reachable = self.arm.depart(there, travel * override, linear, robot_s, turn * override)
        self._move, self._error = _Move(seq, reachable), cb.ErrorText(0, "", "")
        self.moves_accepted += 1
        self.external_axes = self._external_goal(external_axes)
        return None

    def _external_goal(self, asked: cb.Six) -> tuple[float, ...]:
        """External axes at the end of a move: as asked where there is an axis."""
        pairs = zip(self.external_axes, asked, strict=True)
        return tuple(have if have >= 8.9e9 else wanted for have, wanted in pairs)

    def _set_output(self, seq: int, request: cb.SetOutput, now_s: float) -> cb.Reply:
        self.outputs[request.output] = request.on
        return cb.OutputDone()

    def _get_setup(self, seq: int, request: cb.GetSetup, now_s: float) -> cb.Reply:
        load_kg, centre_mm = self.load
        travel_deg = float(np.degrees(MAX_JOINT_TRAVEL_RAD))
        limits = (REACH_MM, MAX_SPEED_MM_S, travel_deg)
        return cb.Setup(load_kg, centre_mm, *limits, self.box.low_mm, self.box.high_mm)

    # --- inside ---

    def _report(self, now_s: float) -> cb.Report:
        robot_s = self.robot_s(now_s)
        progress = self.arm.progress_at(robot_s) if self._move is not None else 1.0
        seq, status = self._finished
        return cb.Report(self.flags(now_s), seq, status, round(1000 * min(progress, 1.0)), self._t_ms(now_s))

    def _finish(self, now_s: float) -> bool:
        """Record the end of the move once the arm has settled; returns whether a move ended."""
        move = self._move
        if move is None or not self.settles or not self.arm.is_settled_at(self.robot_s(now_s)):
            return False
        blocked = Status.MOTION_ERROR if move.reachable_fraction < 1.0 else Status.OK
        self._move, self._finished = None, (move.seq, move.result or blocked)
        if self._finished[1] is Status.MOTION_ERROR:
            self._error = cb.ErrorText(50026, TITLES[50026], "the arm cannot follow the line")
            self.record(now_s, 50026, f"move {move.seq} could not follow its line beyond {move.reachable_fraction:.0%}")
        return True

    def _stop(self, now_s: float, result: Status) -> None:
        robot_s = self.robot_s(now_s)
        if self._move is not None and self.arm.is_moving_at(robot_s) and self._move.result is None:
            self._move.result = result
            self.record(now_s, 0, f"move {self._move.seq} stopped: {result.name}")
        self.arm.stop(robot_s)

    def _refuse(self, now_s: float, status: Status, text: str, code: int = 0) -> cb.Refused:
        self.record(now_s, code, f"{status.name}: {text}")
        return cb.Refused(status)

    def _t_ms(self, now_s: float) -> int:
        return int((now_s - self._greeted_at_s) * 1000) % cb.T_MS_WRAP


_HANDLERS: dict[type[Any], Callable[[Controller, int, Any, float], cb.Reply]] = {
    cb.Ping: lambda *_: cb.Pong(),
    cb.Hello: Controller._hello,
    cb.GetPose: Controller._pose,
    cb.Move: Controller._move_request,
    cb.Stop: Controller._stop_request,
    cb.GetStatus: lambda controller, seq, request, now_s: controller._report(now_s),
    cb.SetArmed: Controller._arm,
    cb.GetJoints: Controller._joints,
    cb.Bye: Controller._bye,
    cb.MoveJoints: Controller._move_joints,
    cb.GetError: lambda controller, *_: controller._error,
    cb.SetOutput: Controller._set_output,
    cb.GetSetup: Controller._get_setup,
}


def float32_tuple(values: Array | tuple[float, ...]) -> Any:
    """Round to float32, as a controller stores numbers."""
    return tuple(float(value) for value in np.asarray(values, np.float32))


def goal_joints(
    arm: AnyArm, base_T_flange: Array, configuration: cb.ConfData, here_rad: Array, arm_angle_deg: float = 0.0
) -> Array:
    """Joints (6,) in that configuration, or in the neighbouring one with the least joint travel (cell_found_near).

    Of an arm with seven axes (7,), with that arm angle and in that configuration. Raises UnreachablePoseError.
    """
    if isinstance(arm, SevenAxisArm):
        return arm.matching(base_T_flange, float(np.radians(arm_angle_deg)), configuration, here_rad)
    try:
        joints: Array = arm.matching(base_T_flange, configuration, near_rad=here_rad)
        return joints
    except OtherConfiguration:
        found = [*_near(arm, base_T_flange, configuration, here_rad)]
        if not found:
            raise
    return min(found, key=lambda each: float(np.abs(each - here_rad).max()))


def _near(arm: Arm, base_T_flange: Array, configuration: cb.ConfData, here_rad: Array) -> Iterator[Array]:
    cf1, cf4, cf6, cfx = configuration
    for i, j, k in product((-1, 0, 1), repeat=3):
        with suppress(UnreachablePoseError):
            yield arm.matching(base_T_flange, (cf1 + i, cf4 + j, cf6 + k, cfx), near_rad=here_rad)


def speeds_sharing(start: Array, end: Array, limit_mm_s: float, reach_mm: float) -> tuple[float, float]:
    """Speed (mm/s) and turn (rad/s) of the flange between poses (4, 4), as cell_speed of CELL_motion shares them.

    speed + turn * reach_mm is the limit: no point within `reach_mm` of the flange moves faster.
    """
    way_mm = float(np.linalg.norm(end[:3, 3] - start[:3, 3]))
    sweep_mm = reach_mm * float(rotation_angle_rad(start[:3, :3].T @ end[:3, :3]))
    share = way_mm / (way_mm + sweep_mm) if way_mm + sweep_mm > 0.001 else 0.9
    share = min(max(share, 0.25), 0.9)
    return share * limit_mm_s, (1.0 - share) * limit_mm_s / reach_mm
