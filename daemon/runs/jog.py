"""Jogs: one small move of the flange in base or flange, a turn of one axis, or all axes to their angles.

And a motion to a pose that lasts while somebody holds a button: short steps, and a stop when the button is let go.
"""

import asyncio
from dataclasses import dataclass, replace
from math import ceil, radians
from typing import Protocol

import numpy as np

from calibration.documents.pose import PoseDocument
from calibration.documents.validation import Document
from calibration.sentences.sentence import Sentence
from calibration.transforms import Array, difference, rotation_from_vector, transform, vector_from_rotation
from daemon.cell.cell import AXES_NOT_MOVED, READ_ONLY, Cell
from daemon.cell.held_button import HeldButton
from daemon.cell.motion_rules import MotionRules
from daemon.cell.settling import check_arrival, check_external_axes
from daemon.config.settings import TaughtPose
from daemon.errors import CellNotReady, PoseRefused
from daemon.model.requests import JogRequest
from daemon.runs.run_log import RunLog, RunResult
from drivers.interfaces import JointGoal, MoveGoal, PoseReading
from drivers.robots.base_frame import configured

SPEED_MM_S = 50.0
"""Of a request that states none."""

MAX_TRAVEL_DEG = 60.0
"""Limit of joint travel in a step of the flange: near a singularity a small step can turn an axis over."""

MAX_STEP_MM, MAX_STEP_RAD = 20.0, radians(2.0)
"""Of one command: without the daemon, or the link to it, the arm goes no farther."""

MAX_STEP_TRAVEL_DEG = 20.0
"""Of an axis in one step: near a singularity a short step can turn an axis far."""

NO_STATION = 0


class SmallMove(Protocol):
    """A move that somebody asks for, and a run of its own."""

    @property
    def request(self) -> Document: ...

    async def goal(self) -> MoveGoal | JointGoal:
        """The checked first move from the present pose; nothing moves."""
        ...

    async def drive(self, log: RunLog) -> RunResult:
        """Move, and stop and disarm in every case."""
        ...


@dataclass(frozen=True)
class Jog:
    """One jog under the rules of every commanded move, from where the arm stands when it begins."""

    cell: Cell
    rules: MotionRules
    request: JogRequest

    async def goal(self) -> MoveGoal | JointGoal:
        """The checked move from the present pose. Raises CellNotReady, PoseRefused, DeviceError; nothing moves."""
        if not self.cell.robot.capabilities.moves:
            raise CellNotReady((READ_ONLY,))
        speed_mm_s = self.rules.speed_mm_s(self.request.speed_mm_s, SPEED_MM_S)
        if self.request.shift_mm is not None or self.request.turn_deg is not None:
            here = await self.cell.robot.read_pose()
            pose = TaughtPose.of(_stepped(here.base_T_flange, self.request))
            rules = self.rules.with_travel_below(MAX_TRAVEL_DEG)
            return replace(await rules.goal(NO_STATION, pose, self.cell.robot), speed_mm_s=speed_mm_s)
        program = configured(self.cell.robot)
        if program is None:
            raise PoseRefused(NO_STATION, AXES_NOT_MOVED, Sentence("move-flange-instead"))
        self.rules.check_controllers_box(*(await program.read_setup()).world_box_mm)
        start_rad, here = await self.cell.robot.read_joints(), await self.cell.robot.read_pose()
        end_rad = _turned(start_rad, self.request)
        self.rules.check_joint_move(here, start_rad, end_rad)
        return JointGoal(end_rad, speed_mm_s=speed_mm_s)

    async def drive(self, log: RunLog) -> RunResult:
        """The run of a jog alone. Raises as `carry_out`."""
        return result_of(await self.carry_out(Sentence("holder-run", run=log.id)))

    async def carry_out(self, holder: str) -> PoseReading:
        """Move, and stop and disarm in every case; returns the pose and joints at rest. Raises as `goal`, CellBusy."""
        async with self.cell.hold(holder):
            return await self.carry_out_as_holder()

    async def carry_out_as_holder(self) -> PoseReading:
        """As `carry_out`, for a run that holds the cell already."""
        async with self.cell.armed() as robot:
            goal = await self.goal()
            if isinstance(goal, JointGoal):
                await self.cell.move_to_joints(goal)
                return await self.cell.read_settled_pose()
            await self.cell.move_to(goal)
            reading = await self.cell.read_settled_pose()
            check_arrival(goal.base_T_flange, reading, robot.capabilities.pose_convention)
            return reading


def result_of(reading: PoseReading) -> RunResult:
    """The result of a jog's run: where the arm stands."""
    joints = [] if reading.joints_rad is None else np.degrees(reading.joints_rad).round(6).tolist()
    return {"base_T_flange": PoseDocument.of(reading.base_T_flange).model_dump(mode="json"), "joints_deg": joints}


def _stepped(base_T_flange: Array, request: JogRequest) -> Array:
    """base_T_flange (4, 4) after the step."""
    rotation = rotation_from_vector(np.radians(request.turn_deg or (0.0, 0.0, 0.0)))
    shift_mm = np.array(request.shift_mm or (0.0, 0.0, 0.0))
    if request.frame == "flange":
        return base_T_flange @ transform(rotation, shift_mm)
    return transform(rotation @ base_T_flange[:3, :3], base_T_flange[:3, 3] + shift_mm)


def _turned(start_rad: Array, request: JogRequest) -> Array:
    """Joints (n,) in rad after the move. Raises PoseRefused for a number of axes that the arm does not have."""
    if request.joints_deg is not None:
        if len(request.joints_deg) != len(start_rad):
            what = Sentence("angles-not-axes", given=len(request.joints_deg), axes=len(start_rad))
            raise PoseRefused(NO_STATION, what, Sentence("give-each-angle"))
        return np.radians(request.joints_deg)
    assert request.axis is not None and request.by_deg is not None
    if request.axis > len(start_rad):
        what = Sentence("no-such-axis", axis=request.axis, axes=len(start_rad))
        raise PoseRefused(NO_STATION, what, Sentence("choose-axis", axes=len(start_rad)))
    end_rad = start_rad.copy()
    end_rad[request.axis - 1] += np.radians(request.by_deg)
    return end_rad


@dataclass(frozen=True)
class HeldMove(Jog):
    """A move of the flange along a straight line to `request.to`, in steps, each under the rules of every jog."""

    button: HeldButton

    async def goal(self) -> MoveGoal:
        """The first step, when the whole way is allowed. Raises as `Jog.goal`; nothing moves."""
        if not self.cell.robot.capabilities.moves:
            raise CellNotReady((READ_ONLY,))
        return await self._step((await self._way(await self.cell.robot.read_pose()))[0])

    async def carry_out_as_holder(self) -> PoseReading:
        """Move while the button is held; the pose and joints at rest, there or on the way. Raises as `Jog`."""
        moving = asyncio.create_task(self._move(), name="moves while a button is held")
        moving.add_done_callback(lambda done: done.cancelled() or done.exception())

        def stop() -> None:
            if not moving.cancelling():  # a second cancellation would end its cleaning up
                moving.cancel()  # first: nothing more is sent to the arm, also when its answer has come meanwhile
            self.cell.stop_motion()

        assert self.request.hold is not None
        self.cell.buttons[self.request.hold] = self.button
        self.button.watch(stop)
        try:
            await asyncio.wait([moving])
        except asyncio.CancelledError:
            stop()
            await asyncio.wait([moving])
            raise
        finally:
            del self.cell.buttons[self.request.hold]
            self.button.release()
        if not moving.cancelled():
            moving.result()
        return await self.cell.read_settled_pose()

    async def _move(self) -> None:
        await self.button.first.wait()
        async with self.cell.armed() as robot:
            first = await robot.read_pose()
            for pose in await self._way(first):
                goal = await self._step(pose)
                await self.cell.move_to(goal)
                reading = await robot.read_pose()
                check_external_axes(first.external_axes, reading.external_axes)
                check_arrival(goal.base_T_flange, reading, robot.capabilities.pose_convention)

    async def _way(self, here: PoseReading) -> tuple[TaughtPose, ...]:
        """The ends of the steps, the last one `request.to`. Raises PoseRefused where any of them is not allowed."""
        assert self.request.to is not None
        end = TaughtPose.of(self.request.to.transform())
        self.rules.check_inside_box(NO_STATION, end)
        poses = tuple(map(TaughtPose.of, steps_between(here.base_T_flange, end.transform())))
        joints = await self.cell.robot.read_joints() if self.rules.arm else None
        try:
            await asyncio.to_thread(self.rules.with_travel_below(MAX_STEP_TRAVEL_DEG).check_poses, poses, joints)
        except PoseRefused as refused:
            what = Sentence("on-straight-way", step=refused.station, why=refused.why)
            raise PoseRefused(NO_STATION, what, Sentence("move-nearer")) from None
        return poses

    async def _step(self, pose: TaughtPose) -> MoveGoal:
        speed_mm_s = self.rules.speed_mm_s(self.request.speed_mm_s, SPEED_MM_S)
        rules = self.rules.with_travel_below(MAX_STEP_TRAVEL_DEG)
        return replace(await rules.goal(NO_STATION, pose, self.cell.robot), speed_mm_s=speed_mm_s)


def steps_between(a_T_b: Array, a_T_c: Array) -> list[Array]:
    """Poses (4, 4) on the straight line from b to c, each at most MAX_STEP_MM and MAX_STEP_RAD on; the last is c."""
    off_mm, off_rad = difference(a_T_b, a_T_c)
    count = max(1, ceil(max(off_mm / MAX_STEP_MM, off_rad / MAX_STEP_RAD)))
    turn_rad, shift_mm = vector_from_rotation(a_T_b[:3, :3].T @ a_T_c[:3, :3]), a_T_c[:3, 3] - a_T_b[:3, 3]
    on_the_way = [
        transform(a_T_b[:3, :3] @ rotation_from_vector(share * turn_rad), a_T_b[:3, 3] + share * shift_mm)
        for share in np.arange(1, count) / count
    ]
    return [*on_the_way, a_T_c]
