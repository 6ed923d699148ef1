"""What must hold at the mock cell whatever is asked of the daemon: seen at the arm itself, not over the daemon."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from calibration.transforms import Array, map_points
from tests.mock_robot.running_cell import RunningCell

BOX_SLACK_MM = 1.5
"""BOX_SLACK_MM of the motion rules, and what the controller rounds."""

TIP_SLACK_MM = 2.0
"""MAX_BEYOND_MM of an approach, and how exactly the camera sees a point."""


@dataclass
class Approaching:
    """An approach that is asked for: of the tip (3,) in the flange, along `direction` (3,), to a point (3,)."""

    tip_mm: Array
    direction: Array | None
    point_mm: Array

    def left_mm(self, base_T_flange: Array) -> Array:
        """Of poses (n, 4, 4): how far before the true point the tip is along the approach, (n,)."""
        along = base_T_flange[0, :3, 2] if self.direction is None else self.direction
        tips = map_points(base_T_flange, self.tip_mm[None])[:, 0]
        found: Array = (self.point_mm - tips) @ (along / np.linalg.norm(along))
        return found


@dataclass
class Witness:
    """Notes what is wrong. `asking`: requests on their way of somebody who may; `run`: one that was asked for and that
    nobody has seen the end of. `approaching`: what an approach on its way asks for; `beyond`: what led its tip beyond
    the point meanwhile, which is wrong unless another run did.
    """

    cell: RunningCell
    box_mm: Array
    carried_mm: Array
    asking: int = 0
    run: str = ""
    approaching: Approaching | None = None
    beyond: list[str] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)
    departures: int = 0

    @property
    def consent(self) -> bool:
        return self.asking > 0 or bool(self.run)

    def watch(self) -> None:
        """Look at every departure and every arming from now on."""
        controller = self.cell.controller
        depart: Callable[..., Any] = controller.arm.depart

        def departs(joints: Array, speed_mm_s: float, linear: bool, now_s: float, *more: Any, **named: Any) -> Any:
            found = depart(joints, speed_mm_s, linear, now_s, *more, **named)
            self.departures += 1
            if not self.consent:
                self.wrong.append(f"consent: departure {self.departures} was asked for by nobody who may")
            self._check_way(now_s)
            return found

        controller.arm.depart = departs  # type: ignore[method-assign]
        witness, kind = self, type(controller)

        class Watched(kind):  # type: ignore[misc,valid-type]
            @property
            def armed(self) -> bool:
                return bool(self.__dict__["armed"])

            @armed.setter
            def armed(self, value: bool) -> None:
                if value and not witness.consent:
                    witness.wrong.append("armed: by nobody who may")
                self.__dict__["armed"] = value

        controller.__class__ = Watched

    def _check_way(self, robot_s: float) -> None:
        """The whole way of the move that has just begun."""
        arm = self.cell.controller.arm
        times = np.linspace(robot_s, max(arm.end_s, robot_s), 15)
        flanges = arm.arm.forward(np.array([arm.joints_at(float(each)) for each in times]))
        points = map_points(flanges, np.array([np.zeros(3), *self.carried_mm])).reshape(-1, 3)
        low, high = self.box_mm
        outside_mm = float(np.maximum(low - points, points - high).max())
        if outside_mm > BOX_SLACK_MM:
            self.wrong.append(f"box: departure {self.departures} leads {outside_mm:.1f} mm out of it")
        if self.approaching is not None:
            left_mm = float(self.approaching.left_mm(flanges).min())
            if left_mm < -TIP_SLACK_MM:
                self.beyond.append(f"tip: departure {self.departures} leads {-left_mm:.1f} mm beyond the point")

    def check_stopped(self, what: str) -> None:
        """At this moment the arm must stand and be disarmed."""
        if self.cell.moving or self.cell.controller.armed:
            self.wrong.append(f"abort: {what}, and the arm is moving or armed")
