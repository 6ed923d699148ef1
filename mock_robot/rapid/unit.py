"""The mechanical unit of a RAPID program: one move at a time, which can be held, stopped and cleared."""

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from calibration.kinematics.arm import Arm
from calibration.transforms import Array, inverse
from mock_robot.cabinet.cabinet import MANUAL_SPEED_MM_S, MIN_OVERRIDE, Cabinet
from mock_robot.cabinet.panel import Mode
from mock_robot.rapid.postures import singles

POLL_S = 0.02
"""Polling period of conditions that have no event, wire time."""
MAX_OFF_PATH_RAD = np.radians(1.0)
"""Beyond it an interrupted move is not resumed; a controller's limit is in mm (Path Return Region)."""


@dataclass
class MoveOrder:
    """One move; `reachable_fraction` below 1 when the line cannot be followed to its end."""

    joints: Array
    speed_mm_s: float
    turn_rad_s: float
    linear: bool
    departed: bool = False
    reachable_fraction: float = 1.0


@dataclass
class MotionUnit:
    """The motion task's arm. `held`: program stopped or motors off; `stopped_by`: tasks that called StopMove.

    An interrupted move continues from where the arm stands once nothing prevents it, as on a controller; only ClearPath
    (or leaving the program) ends it. `egm`: sessions of the EGM identities that are taken. `active`: name and value of
    the tool, work object and load in use, by type.
    """

    cabinet: Cabinet
    clock: Callable[[], float]
    task_name: str
    moved: Callable[[], None]
    external: list[float] = field(default_factory=list)
    override_percent: float = 100.0
    max_speed_mm_s: float = 5000.0
    egm: dict[int, Any] = field(default_factory=dict)
    egm_ports: dict[int | None, int] = field(default_factory=dict)
    active: dict[str, tuple[str, Any]] = field(default_factory=dict)
    stopped_by: set[str] = field(default_factory=set, init=False)
    held: bool = field(default=True, init=False)
    _order: MoveOrder | None = field(default=None, init=False)
    _left_at: Array | None = field(default=None, init=False)
    _turn: Any = field(default_factory=threading.RLock, init=False)

    def __post_init__(self) -> None:
        self.external = singles(self.cabinet.external_axes)

    @property
    def arm(self) -> Arm:
        arm = self.cabinet.arm.arm
        assert isinstance(arm, Arm), "the interpreter moves six axes"
        return arm

    @property
    def time_scale(self) -> float:
        """Ratio of the arm's time to wire time."""
        return self.cabinet.time_scale

    def now_s(self) -> float:
        return self.cabinet.robot_s(self.clock())

    # --- called by the program ---

    def order(self, joints: Array, speed_mm_s: float, turn_rad_s: float, linear: bool) -> None:
        """Start a move; `has_arrived` reports its end."""
        with self._turn:
            self._order, self._left_at = MoveOrder(joints, speed_mm_s, turn_rad_s, linear), None
            self._depart()
            self.cabinet.moves_accepted += 1
            self.cabinet.external_axes = tuple(self.external)
        self.moved()

    def has_arrived(self) -> bool:
        """Whether the arm stands at its goal, or the move was cleared."""
        with self._turn:
            self._depart()
            return self._order is None or (self._order.departed and not self.is_moving())

    def is_blocked(self) -> bool:
        """Whether the arm stopped at the end of what it can follow."""
        return self._order is not None and self._order.reachable_fraction < 1.0

    def arrives_in_s(self) -> float:
        """Wire time until `has_arrived` should be checked again."""
        order = self._order
        return self._wire_s_until(self.cabinet.arm.end_s) if order is not None and order.departed else POLL_S

    def stop(self, by: str) -> None:
        """StopMove of a task."""
        with self._turn:
            self.stopped_by.add(by)
            self._brake()

    def start(self, by: str) -> None:
        """StartMove of the same task: a move that was not cleared continues."""
        with self._turn:
            self.stopped_by.discard(by)
            self._depart()

    def is_off_path(self) -> bool:
        """Whether the arm no longer stands where an interrupted move left it."""
        if self._order is None or self._order.departed or self._left_at is None:
            return False
        return bool(np.abs(self.joints_now() - self._left_at).max() > MAX_OFF_PATH_RAD)

    def clear(self) -> None:
        with self._turn:
            self._brake()
            self._order = None

    def end_egm(self) -> None:
        for session in list(self.egm.values()):
            session.end(free=True)
        self.egm.clear()

    # --- called by the cabinet ---

    def hold(self) -> None:
        """Stop the arm, since the program stopped or the motors lost power."""
        with self._turn:
            self.held = True
            self._brake()

    def reset(self) -> None:
        """Reset at a restart of the controller: no move, no stops."""
        with self._turn:
            self.clear()
            self.stopped_by.clear()

    # --- state of the arm ---

    def is_moving(self) -> bool:
        return self.cabinet.arm.is_moving_at(self.now_s())

    def is_settled(self, seconds: float, since_s: float) -> bool:
        """Whether the arm has stood still for `seconds` of its own time, counted from `since_s` at the earliest."""
        return self.cabinet.settles and self.now_s() >= self._standstill_since_s(seconds, since_s)

    def settles_in_s(self, seconds: float, since_s: float) -> float:
        """Wire time until `is_settled` should be checked again."""
        return self._wire_s_until(self._standstill_since_s(seconds, since_s)) if self.cabinet.settles else POLL_S

    def _wire_s_until(self, at_s: float) -> float:
        """Wire time to then on the arm's clock; at most a second, since the motion may change."""
        return min(max(at_s - self.now_s(), 0.0) / self.time_scale + 1e-4, 1.0)

    def _standstill_since_s(self, seconds: float, since_s: float) -> float:
        return max(self.cabinet.arm.end_s, since_s) + seconds

    def joints_now(self) -> Array:
        """Axes (6,) in rad."""
        return self.cabinet.arm.joints_at(self.now_s())

    def external_axes(self) -> list[float]:
        return list(self.external)

    def world_T_flange(self, joints: Array, external: list[float]) -> Array:
        """Flange pose of joints (6,), with external axes at those values."""
        return self.cabinet.mounting.reported_world_T_base(tuple(external)) @ self.arm.forward(joints)

    def joints_for(self, world_T_flange: Array, confdata: list[float], external: list[float]) -> Array:
        """Joints for a flange pose in that configuration; raises PoseRefused."""
        cf1, cf4, cf6, cfx = (round(part) for part in confdata)
        base_T_flange = inverse(self.cabinet.mounting.reported_world_T_base(tuple(external))) @ world_T_flange
        joints: Array = self.arm.matching(base_T_flange, (cf1, cf4, cf6, cfx), near_rad=self.joints_now())
        return joints

    def _depart(self) -> None:
        order = self._order
        if order is None or order.departed or self.held or self.stopped_by:
            return
        order.departed = True
        panel = self.cabinet.panel
        turn_rad_s = order.turn_rad_s * max(panel.speed_override, MIN_OVERRIDE)
        order.reachable_fraction = self.cabinet.arm.depart(
            order.joints, self._speed(order), order.linear, self.now_s(), turn_rad_s
        )

    def _speed(self, order: MoveOrder) -> float:
        panel = self.cabinet.panel
        programmed = min(order.speed_mm_s * self.override_percent / 100, self.max_speed_mm_s)
        cap = MANUAL_SPEED_MM_S if panel.mode is Mode.MANR else np.inf
        return float(min(programmed, cap) * max(panel.speed_override, MIN_OVERRIDE))

    def _brake(self) -> None:
        """A move that was under way continues later; one that has arrived is over."""
        arm, was_moving = self.cabinet.arm, self.is_moving()
        arm.stop(self.now_s())
        if self._order is not None and was_moving:
            self._left_at = arm.joints_at(arm.end_s) if self._order.departed else self._left_at
            self._order.departed = False
