"""The mechanical unit as a RAPID program moves it: one order at a time, held, stopped, cleared."""

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from calibration.kinematics.arm import Arm
from calibration.transforms import Array
from mock_robot.cabinet.cabinet import MANUAL_SPEED_MM_S, SLOWEST_OVERRIDE, Cabinet
from mock_robot.cabinet.panel import Mode
from mock_robot.rapid.postures import singles

LOOK_S = 0.02
"""How often to look at what nobody announces, wire time."""


@dataclass
class Order:
    """Where to go, and how; `blocked_at` below 1 when the line cannot be followed to its end."""

    joints: Array
    speed_mm_s: float
    linear: bool
    departed: bool = False
    blocked_at: float = 1.0


@dataclass
class MotionUnit:
    """The arm of the motion task. `held`: the program stands or the motors are off; `stopped_by`: tasks with StopMove.

    An order that was interrupted goes on from where the arm stands as soon as nothing is against it, as on a
    controller; only ClearPath (or leaving the program) ends it.
    """

    cabinet: Cabinet
    clock: Callable[[], float]
    task_name: str
    moved: Callable[[], None]
    external: list[float] = field(default_factory=list)
    override_percent: float = 100.0
    speed_most: float = 5000.0
    stopped_by: set[str] = field(default_factory=set, init=False)
    held: bool = field(default=True, init=False)
    _order: Order | None = field(default=None, init=False)
    _turn: Any = field(default_factory=threading.RLock, init=False)

    def __post_init__(self) -> None:
        self.external = singles(self.cabinet.external_axes)

    @property
    def arm(self) -> Arm:
        """Its kinematics."""
        return self.cabinet.arm.arm

    @property
    def time_scale(self) -> float:
        """How much faster than wire time the arm's time runs."""
        return self.cabinet.time_scale

    def now_s(self) -> float:
        """The arm's time."""
        return self.cabinet.robot_s(self.clock())

    # --- the program ---

    def order(self, joints: Array, speed_mm_s: float, linear: bool) -> None:
        """Go there; `arrived` tells when."""
        with self._turn:
            self._order = Order(joints, speed_mm_s, linear)
            self._depart()
            self.cabinet.moves_accepted += 1
            self.cabinet.external_axes = tuple(self.external)
        self.moved()

    def arrived(self) -> bool:
        """Does the arm stand where it was ordered, or was the order cleared?"""
        with self._turn:
            self._depart()
            return self._order is None or (self._order.departed and not self.moving())

    def blocked(self) -> bool:
        """Did the arm come to an end of what it can follow?"""
        return self._order is not None and self._order.blocked_at < 1.0

    def arrives_in_s(self) -> float:
        """When to look again, wire time."""
        order = self._order
        return self.stands_in_s() if order is not None and order.departed else LOOK_S

    def stop(self, by: str) -> None:
        """StopMove of a task."""
        with self._turn:
            self.stopped_by.add(by)
            self._brake()

    def start(self, by: str) -> None:
        """StartMove of the same task: an order that was not cleared goes on."""
        with self._turn:
            self.stopped_by.discard(by)
            self._depart()

    def may_start(self) -> bool:
        """Is the robot able to move at all?"""
        return not self.held

    def clear(self) -> None:
        """Drop the order."""
        with self._turn:
            self._brake()
            self._order = None

    # --- the cabinet ---

    def hold(self) -> None:
        """The program stops, or the motors lose power: so does the arm."""
        with self._turn:
            self.held = True
            self._brake()

    def free(self) -> None:
        """The program runs: what was interrupted goes on when its task does."""
        self.held = False

    def reset(self) -> None:
        """A restart of the controller: nothing is ordered, nothing stopped."""
        with self._turn:
            self.clear()
            self.stopped_by.clear()

    # --- where the arm is ---

    def moving(self) -> bool:
        """Is it under way?"""
        return self.cabinet.arm.moving_at(self.now_s())

    def stands_in_s(self) -> float:
        """Wire time to the end of its motion; at most a second, for somebody may change that."""
        return min(max(self.cabinet.arm.end_s - self.now_s(), 0.0) / self.time_scale + 1e-4, 1.0)

    def settled(self, seconds: float, since_s: float) -> bool:
        """Has it stood for so long, from `since_s` on, in the arm's time?"""
        return self.cabinet.settles and self.now_s() >= self._stood_at_s(seconds, since_s)

    def settles_in_s(self, seconds: float, since_s: float) -> float:
        """When to look again, wire time."""
        if not self.cabinet.settles:
            return LOOK_S
        return min(max(self._stood_at_s(seconds, since_s) - self.now_s(), 0.0) / self.time_scale + 1e-4, 1.0)

    def _stood_at_s(self, seconds: float, since_s: float) -> float:
        return max(self.cabinet.arm.end_s, since_s) + seconds

    def joints_now(self) -> Array:
        """Axes (6,) in rad."""
        return self.cabinet.arm.joints_at(self.now_s())

    def external_axes(self) -> list[float]:
        """As the program has them."""
        return list(self.external)

    def joints_for(self, base_T_flange: Array, confdata: list[float]) -> Array:
        """The axes that bring the flange there in that configuration; raises PoseRefused."""
        cf1, cf4, cf6, cfx = (round(part) for part in confdata)
        joints: Array = self.arm.matching(base_T_flange, (cf1, cf4, cf6, cfx), near_rad=self.joints_now())
        return joints

    def _depart(self) -> None:
        order = self._order
        if order is None or order.departed or self.held or self.stopped_by:
            return
        order.departed = True
        order.blocked_at = self.cabinet.arm.depart(order.joints, self._speed(order), order.linear, self.now_s())

    def _speed(self, order: Order) -> float:
        panel = self.cabinet.panel
        programmed = min(order.speed_mm_s * self.override_percent / 100, self.speed_most)
        cap = MANUAL_SPEED_MM_S if panel.mode is Mode.MANR else np.inf
        return float(min(programmed, cap) * max(panel.speed_override, SLOWEST_OVERRIDE))

    def _brake(self) -> None:
        self.cabinet.arm.stop(self.now_s())
        if self._order is not None:
            self._order.departed = False
