"""The arm brings a tip before a point that the camera has seen, then nearer by single steps; each move is asked for."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from calibration.kinematics.stance import Stance
from calibration.sentences.sentence import Sentence
from calibration.transforms import Array, map_points
from daemon.cell.cell import READ_ONLY, Cell
from daemon.cell.motion_rules import MotionRules
from daemon.cell.settling import check_arrival, check_external_axes
from daemon.config.settings import TaughtPose
from daemon.errors import CellNotReady, PoseRefused
from daemon.model.records import FlangePose
from daemon.runs.jog import MAX_TRAVEL_DEG, NO_STATION, result_of
from daemon.runs.run_log import RunLog, RunResult
from drivers.interfaces import MoveGoal, PoseReading
from extensions.touch.mathematics.with_arm import base_turn
from extensions.touch.requests import ApproachRequest
from extensions.touch.touch_tests import PointToTouch

STAND_OFF_SPEED_MM_S, STEP_SPEED_MM_S = 50.0, 5.0
"""Of a request that states none."""

MAX_BEYOND_MM = 0.5
"""A tip that has touched the point is reported on either side of it, and may go back."""

MAX_FROM_SIGHT_DEG = 60.0
"""Between the approach and each line of sight. A camera sees a surface within 60 degrees of its normal, so that a
surface's normal is within that; and the stand-off is before the point for the camera, too, by half of it."""

MAX_BESIDE_MM = 2.0
"""A step is made from the line of the approach only, and the tip may be this far beside it."""

NEAR_MM = 0.5
"""How far before the stand-off the tip may be when a step begins."""

MIN_STEP_MM = 0.01
"""Less than this is left: the tip is where the point was seen. No way back, or aside, is made for less."""


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

    def require_in_sight(self, sights: Array) -> None:
        """Raises PoseRefused for a direction that leads through the part: not that of the looks `sights` (k, 3)."""
        farthest_deg = float(np.degrees(np.arccos(np.clip(sights @ self.direction, -1.0, 1.0)).max()))
        if farthest_deg > MAX_FROM_SIGHT_DEG:
            fix = Sentence("give-along", limit_deg=MAX_FROM_SIGHT_DEG)
            raise PoseRefused(NO_STATION, Sentence("approach-out-of-sight", angle_deg=farthest_deg), fix)

    def require_tip_first(self, carried_mm: Mapping[str, Array]) -> None:
        """Raises PoseRefused when anything carried (3,) in the base is nearer to the point's plane than the tip."""
        for name, at_mm in carried_mm.items():
            ahead_mm = float((at_mm - self.tip_mm) @ self.direction)
            if ahead_mm > MIN_STEP_MM:
                what = Sentence("carried-before-tip", name=name, ahead_mm=ahead_mm)
                raise PoseRefused(NO_STATION, what, Sentence("correct-tip"))

    def to_stand_off_mm(self, stand_off_mm: float) -> list[Array]:
        """Where the tip goes, (3,) each: back first where it is too near. Raises PoseRefused beyond the point."""
        if self.left_mm < -MAX_BEYOND_MM:
            what = Sentence("tip-beyond-point", beyond_mm=-self.left_mm)
            raise PoseRefused(NO_STATION, what, Sentence("go-to-stand-off"))
        back_mm = stand_off_mm - self.left_mm
        stand_off = self.point_mm - stand_off_mm * self.direction
        straight = min(back_mm, self.beside_mm) <= MIN_STEP_MM
        return [stand_off] if straight else [self.tip_mm - back_mm * self.direction, stand_off]

    def step_mm(self, longest_mm: float, stand_off_mm: float) -> Array:
        """Where the tip goes, (3,), by one step, at most to the point. Raises PoseRefused off the line, or there."""
        if self.beside_mm > MAX_BESIDE_MM or self.left_mm > stand_off_mm + NEAR_MM:
            what = Sentence("tip-beside-approach", left_mm=self.left_mm, beside_mm=self.beside_mm)
            raise PoseRefused(NO_STATION, what, Sentence("stand-off-first"))
        if self.left_mm < MIN_STEP_MM:
            raise PoseRefused(NO_STATION, Sentence("tip-at-point"), Sentence("measure-left"))
        return self.tip_mm + min(longest_mm, self.left_mm) * self.direction


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
        return await self._goal(self._flanges(await self.cell.robot.read_pose())[0])

    async def drive(self, log: RunLog) -> RunResult:
        """Move, stop and disarm in every case; where arm and tip stand. Raises as `goal`, CellBusy, NotStill."""
        async with self.cell.hold(Sentence("holder-run", run=log.id)), self.cell.armed() as robot:
            first = await robot.read_pose()
            for base_T_flange in self._flanges(first):
                goal = await self._goal(base_T_flange)
                await self.cell.move_to(goal)
                reading = await self.cell.read_settled_pose()
                check_external_axes(first.external_axes, reading.external_axes)
                check_arrival(goal.base_T_flange, reading, robot.capabilities.pose_convention)
        at = self._approach(FlangePose.of(reading).stance)
        return {
            **result_of(reading),
            "touch": {
                "point_mm": at.point_mm.round(4).tolist(), "tip_mm": at.tip_mm.round(4).tolist(),
                "left_mm": round(at.left_mm, 4), "beside_mm": round(at.beside_mm, 4),
            },
        }  # fmt: skip

    def _approach(self, here: Stance) -> Approach:
        """By the calibration in use, in the base with an external axis at its zero."""
        (base_T_flange,) = self.point.given.base_T_flange([here])
        along = base_T_flange[:3, 2]
        if self.request.along is not None:
            along = base_turn(self.point.given, here) @ self.request.along
        tip_mm = map_points(base_T_flange, self.point.tip_mm[None])[0]
        return Approach(self.point.seen.point_mm, along / np.linalg.norm(along), tip_mm)

    def _flanges(self, reading: PoseReading) -> list[Array]:
        """The reported poses (4, 4) to go to, in order. Raises PoseRefused for a way that could meet the part."""
        here = FlangePose.of(reading).stance
        at, (base_T_flange,) = self._approach(here), self.point.given.base_T_flange([here])
        at.require_in_sight(self.point.seen.sights)
        carried = {f"carried_mm[{index}]": point for index, point in enumerate(self.rules.robot.points_mm[1:])}
        carried |= {"the flange": np.zeros(3), **self.point.carried_mm()}
        at.require_tip_first({name: map_points(base_T_flange, mm[None])[0] for name, mm in carried.items()})
        if self.request.step_mm is None:
            tips_mm = at.to_stand_off_mm(self.request.stand_off_mm)
        else:
            tips_mm = [at.step_mm(self.request.step_mm, self.request.stand_off_mm)]
        flanges = []
        for tip_mm in tips_mm:
            shifted = reading.base_T_flange.copy()
            shifted[:3, 3] += base_turn(self.point.given, here).T @ (tip_mm - at.tip_mm)
            flanges.append(shifted)
        return flanges

    async def _goal(self, base_T_flange: Array) -> MoveGoal:
        """The straight move of the flange there. Raises PoseRefused, DeviceError."""
        rules = self.rules.with_travel_below(MAX_TRAVEL_DEG)
        goal = await rules.goal(NO_STATION, TaughtPose.of(base_T_flange), self.cell.robot)
        return replace(goal, speed_mm_s=self._speed(), path="linear")

    def _speed(self) -> float:
        usual = STAND_OFF_SPEED_MM_S if self.request.step_mm is None else STEP_SPEED_MM_S
        return self.rules.speed_mm_s(self.request.speed_mm_s, usual)
