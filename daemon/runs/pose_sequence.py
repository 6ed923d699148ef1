"""Pose sequences of a run: the protocol, and the sequence of fixed poses."""

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Protocol

from calibration.problem import Problem, View
from calibration.sentences.sentence import Sentence, as_sentence
from daemon.cell.cell import Cell
from daemon.cell.motion_rules import MotionRules
from daemon.cell.settling import check_arrival
from daemon.config.settings import TaughtPose
from daemon.errors import TargetNotSeen
from daemon.model.run_states import RunState
from daemon.runs.run_log import RunLog
from daemon.sessions.session_writer import SessionWriter
from drivers.interfaces import PoseReading

StationCallback = Callable[[PoseReading], Awaitable[None]]


class PoseSequence(Protocol):
    """A sequence of views: fixed, adaptive (planned after each view), or manual (jogged by an operator)."""

    async def run(self, min_views: int) -> Problem:
        """Take and store the pictures from all poses, and detect the target in them.

        Raises TargetNotSeen when fewer than `min_views` show the target, DeviceError, DaemonError.
        """
        ...


@dataclass(frozen=True)
class FixedSequence:
    """Fixed poses. Each picture is stored at once; detection runs while the arm moves on."""

    poses: tuple[TaughtPose, ...]
    rules: MotionRules
    cell: Cell
    session: SessionWriter
    log: RunLog

    async def run(self, min_views: int) -> Problem:
        searches: list[asyncio.Task[View]] = []

        async def at_station(reading: PoseReading) -> None:
            index = await self.session.add(await self.cell.capture_frame(reading), reading, self.log.timestamp())
            searches.append(asyncio.create_task(self.session.view(index)))

        try:
            await visit_poses(self.poses, self.cell, self.rules, self.log, at_station, last=RunState.DETECTING)
            views = [await search for search in searches]
        finally:
            for search in searches:
                search.cancel()
            await asyncio.gather(*searches, return_exceptions=True)
        check_detections(views, min_views)
        await self.log.advance(RunState.SOLVING)
        return self.session.problem(views)


async def visit_poses(
    poses: tuple[TaughtPose, ...],
    cell: Cell,
    rules: MotionRules,
    log: RunLog,
    at_station: StationCallback,
    last: RunState | None,
) -> None:
    """For each pose move, settle and call `at_station`. `last`: the state after the last, None when the run ends there.

    Arms the robot on entry, and leaves it stopped and disarmed. Raises DeviceError, DaemonError, and the exceptions of
    `at_station`.
    """
    async with cell.motion_lease(Sentence("holder-run", run=log.id)) as robot:
        for station, pose in enumerate(poses, start=1):
            goal = await rules.goal(station, pose, robot)
            await cell.move_to(goal)
            await log.advance(RunState.SETTLING)
            reading = await cell.read_settled_pose()
            check_arrival(goal.base_T_flange, reading, robot.capabilities.pose_convention)
            await log.advance(RunState.CAPTURING)
            await at_station(reading)
            following = RunState.MOVING if station < len(poses) else last
            if following is not None:
                await log.advance(following, captured=True)


def check_detections(views: list[View], min_views: int) -> None:
    """Raises TargetNotSeen, naming the stations without the target, when fewer than `min_views` show it."""
    missing = [view for view in views if view.detection is None]
    if len(views) - len(missing) >= min_views:
        return
    what = Sentence(
        "target-seen-from-few", seen=len(views) - len(missing), stations=len(views), needed=min_views,
        missing=[view.index + 1 for view in missing], why=why_missing(missing[0]),
    )  # fmt: skip
    raise TargetNotSeen(what, Sentence("look-at-pictures", run="{id}", view="{k}"))


def why_missing(view: View) -> Sentence:
    return as_sentence(view.missing[1]) if view.missing else Sentence("target-was-not-found")
