"""A motion to a pose that lasts while somebody holds a button: short steps, and a stop when the button is let go."""

import asyncio
from dataclasses import dataclass, replace
from math import ceil, radians

import numpy as np

from calibration.sentences.sentence import Sentence
from calibration.transforms import Array, difference, rotation_from_vector, transform, vector_from_rotation
from daemon.cell.cell import READ_ONLY
from daemon.cell.held_button import HeldButton
from daemon.cell.settling import check_arrival, check_external_axes
from daemon.config.settings import TaughtPose
from daemon.errors import CellNotReady, PoseRefused
from daemon.runs.jog import NO_STATION, SPEED_MM_S, Jog
from drivers.interfaces import MoveGoal, PoseReading

MAX_STEP_MM, MAX_STEP_RAD = 20.0, radians(2.0)
"""Of one command: without the daemon, or the link to it, the arm goes no farther."""

MAX_STEP_TRAVEL_DEG = 20.0
"""Of an axis in one step: near a singularity a short step can turn an axis far."""


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
