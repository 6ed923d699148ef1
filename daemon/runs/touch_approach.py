"""The arm brings a tip before a point that the camera has seen, then nearer by single steps; each move is asked for."""

from dataclasses import dataclass, replace

import numpy as np

from calibration.transforms import Array, map_points
from daemon.cell.cell import READ_ONLY, Cell
from daemon.cell.motion_rules import MotionRules
from daemon.cell.settling import check_arrival
from daemon.config.settings import TaughtPose
from daemon.errors import CellNotReady, PoseRefused
from daemon.model.requests import ApproachRequest
from daemon.model.run_states import RunEvent
from daemon.runs.jog import MAX_TRAVEL_DEG, NO_STATION, result_of
from daemon.runs.run_log import RunLog
from daemon.runs.supervisor import RunResult
from daemon.runs.touch_tests import PointToTouch
from drivers.interfaces import MoveGoal, PoseReading

STAND_OFF_SPEED_MM_S, STEP_SPEED_MM_S = 50.0, 5.0
"""Of a request that states none."""

MAX_BACK_MM = 150.0
"""Longest way back along the approach before the tip crosses to the stand-off."""

MAX_BESIDE_MM = 2.0
"""A step is made from the line of the approach only, and the tip may be this far beside it."""

NEAR_MM = 0.5
"""How far nearer than the stand-off the tip may be without going back first, and farther before a step."""

MIN_STEP_MM = 0.01
"""Less than this is left: the tip is where the point was seen."""


@dataclass(frozen=True, eq=False)
class Approach:
    """Where the tip stands along the approach to the point: `direction` (3,) in the base, what is left, and beside it.

    `left_mm` is negative when the tip is beyond the point.
    """

    point_mm: Array
    direction: Array
    tip_mm: Array

    @property
    def left_mm(self) -> float:
        return float((self.point_mm - self.tip_mm) @ self.direction)

    @property
    def beside_mm(self) -> float:
        return float(np.linalg.norm(self.point_mm - self.tip_mm - self.left_mm * self.direction))

    def shifts_mm(self, stand_off_mm: float) -> list[Array]:
        """The ways (3,) of the tip to the stand-off: back first where it is too near. Raises PoseRefused."""
        back_mm = stand_off_mm - self.left_mm
        if back_mm > MAX_BACK_MM:
            what = f"the tip stands {-self.left_mm:.0f} mm beyond the point along the approach"
            raise PoseRefused(NO_STATION, what, "jog it to before the point, or give along")
        back = -back_mm * self.direction if back_mm > NEAR_MM else np.zeros(3)
        across = self.point_mm - stand_off_mm * self.direction - self.tip_mm - back
        return [back, across] if back.any() else [across]

    def step_mm(self, longest_mm: float, stand_off_mm: float) -> Array:
        """The way (3,) of one step, at most to the point. Raises PoseRefused away from the line, or at the point."""
        if self.beside_mm > MAX_BESIDE_MM or self.left_mm > stand_off_mm + NEAR_MM:
            what = f"the tip is {self.left_mm:.1f} mm before the point and {self.beside_mm:.1f} mm beside the approach"
            raise PoseRefused(NO_STATION, what, "go to the stand-off first: the same request without step_mm")
        if self.left_mm < MIN_STEP_MM:
            raise PoseRefused(
                NO_STATION,
                "the tip is where the point was seen, and no step goes beyond it",
                "measure what is left as miss_mm, or jog",
            )
        return min(longest_mm, self.left_mm) * self.direction


@dataclass(frozen=True)
class TouchApproach:
    """One approach under the rules of every commanded move, from where the arm stands when it begins."""

    cell: Cell
    rules: MotionRules
    request: ApproachRequest
    point: PointToTouch

    async def goal(self) -> MoveGoal:
        """The first move, checked; nothing moves. Raises CellNotReady, PoseRefused, DeviceError."""
        if not self.cell.robot.capabilities.moves:
            raise CellNotReady((READ_ONLY,))
        here = await self.cell.robot.read_pose()
        return await self._goal(here, self._shifts_mm(here)[0])

    async def drive(self, log: RunLog) -> RunResult:
        """Move, stop and disarm in every case; where arm and tip stand. Raises as `goal`, CellBusy, NotStill."""
        async with self.cell.hold(f"run {log.id}"), self.cell.armed() as robot:
            for shift_mm in self._shifts_mm(await robot.read_pose()):
                goal = await self._goal(await robot.read_pose(), shift_mm)
                await self.cell.move_to(goal)
                reading = await self.cell.read_settled_pose()
                check_arrival(goal.base_T_flange, reading, robot.capabilities.pose_convention)
        at = self._approach(reading)
        return RunEvent.STANDS, {
            **result_of(reading),
            "touch": {
                "point_mm": at.point_mm.round(4).tolist(), "tip_mm": at.tip_mm.round(4).tolist(),
                "left_mm": round(at.left_mm, 4), "beside_mm": round(at.beside_mm, 4),
            },
        }  # fmt: skip

    def _approach(self, here: PoseReading) -> Approach:
        base_T_flange = self.point.given.base_T_flange([here.base_T_flange], [here.joints_rad])[0]
        along = base_T_flange[:3, 2] if self.request.along is None else np.array(self.request.along)
        tip_mm = map_points(base_T_flange, self.point.tip_mm[None])[0]
        return Approach(self.point.point_mm, along / np.linalg.norm(along), tip_mm)

    def _shifts_mm(self, here: PoseReading) -> list[Array]:
        at = self._approach(here)
        if self.request.step_mm is None:
            return at.shifts_mm(self.request.stand_off_mm)
        return [at.step_mm(self.request.step_mm, self.request.stand_off_mm)]

    async def _goal(self, here: PoseReading, shift_mm: Array) -> MoveGoal:
        """The straight move that shifts the flange. Raises PoseRefused, DeviceError."""
        shifted = here.base_T_flange.copy()
        shifted[:3, 3] += shift_mm
        rules = self.rules.with_travel_below(MAX_TRAVEL_DEG)
        goal = await rules.goal(NO_STATION, TaughtPose.of(shifted), self.cell.robot)
        return replace(goal, speed_mm_s=self._speed(), path="linear")

    def _speed(self) -> float:
        usual = STAND_OFF_SPEED_MM_S if self.request.step_mm is None else STEP_SPEED_MM_S
        return self.rules.speed_mm_s(self.request.speed_mm_s, usual)
