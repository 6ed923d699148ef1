"""Poses planned one after the other: look, learn from what was seen, choose the next, move; until enough is known."""

import asyncio
from dataclasses import dataclass, field, replace

from calibration.errors import UndeterminedError
from calibration.planning.exploration import Exploration, turn_flange
from calibration.planning.next_view import NextView, StoppingRule, next_view, plan_ahead
from calibration.planning.plan import Plan, PlanningError
from calibration.planning.reachability import reachable_by
from calibration.planning.scene_belief import ScenePrior
from calibration.planning.viewpoints import ViewpointLimits
from calibration.problem import Problem, View
from calibration.transforms import Array
from daemon.cell.cell import Cell
from daemon.cell.motion_rules import MotionRules
from daemon.cell.settling import require_arrived
from daemon.config.settings import TaughtPose
from daemon.errors import NoPoses, PoseRefused, TargetNotSeen
from daemon.model.records import Planning
from daemon.model.run_states import RunEvent as E
from daemon.runs.pose_sequence import require_seen
from daemon.runs.run_log import RunLog
from daemon.runtime.workers import Workers
from daemon.sessions.session_writer import SessionWriter
from drivers.interfaces import Robot

MOST_MISSES = 3
"""Planned views in which the target was not found; more mean that something is wrong in the cell."""

BRING_IN_VIEW = "drive the arm to where the camera sees the whole target, and start again"


@dataclass(frozen=True)
class AdaptiveRoute:
    """What a run that plans as it goes is given. `wish.views_left` counts the poses it drives to, after the look."""

    guess: ScenePrior
    limits: ViewpointLimits
    wish: StoppingRule
    rules: MotionRules
    assumed: str = ""


@dataclass
class _Progress:
    """Where such a run stands."""

    views: list[View] = field(default_factory=list)
    wish: StoppingRule = field(default_factory=lambda: StoppingRule(0))
    stations: int = 0
    misses: int = 0
    foreseen: Plan | None = None
    planning: Planning = field(default_factory=Planning)


@dataclass(frozen=True)
class AdaptiveSequence:
    """Poses planned after each view. The arm is armed on entry, and left stopped and disarmed, whatever happened."""

    route: AdaptiveRoute
    cell: Cell
    workers: Workers
    session: SessionWriter
    log: RunLog
    _at: _Progress = field(default_factory=_Progress, init=False)

    async def run(self, min_views: int) -> Problem:
        """As PoseSequence. Raises NoPoses and PoseRefused too."""
        self._at.wish, self._at.stations = self.route.wish, self.route.wish.views_left
        self._at.planning = Planning(note=self.route.assumed)
        async with self.cell.motion_lease(f"run {self.log.id}") as robot:
            await self._look()
            await self._explore(robot)
            while (found := await self._next(robot)).base_T_flange is not None:
                await self._told(E.PLANNED, found)
                if (await self._visit_foreseeing(robot, found)).detection is not None:
                    self._at.wish = replace(self._at.wish, views_left=self._at.wish.views_left - 1)
                else:
                    self._missed()
            self._at.stations = self.log.run.station
            await self._told(E.ENOUGH, found)
        require_seen(self._at.views, min_views)
        await self.log.took(E.DETECTED)
        return self.session.problem(self._at.views)

    async def _look(self) -> None:
        """From where the arm stands: nothing moves."""
        await self.log.took(E.ARRIVED)
        view = await self._capture(captured=False)
        guess = self.route.guess
        if view.detection is None and (guess.mount_T_camera is None or guess.anchor_T_target is None):
            why = view.missing[1] if view.missing else "it was not found"
            raise TargetNotSeen(f"the target is not seen from where the arm stands: {why}", BRING_IN_VIEW)

    async def _explore(self, robot: Robot) -> None:
        """Small turns of the flange where it stands, when nobody said where the camera sits on it."""
        if self.route.guess.mount_T_camera is not None:
            return
        start, exploration = self._at.views[0].base_T_flange, Exploration()
        while (turn := exploration.next_turn()) is not None:
            pose = turn_flange(start, turn)
            if not await self._possible(robot, pose):
                exploration = exploration.after(turn, seen=False)
                continue
            axis, angle_deg = turn
            self._at.stations += 1
            note = f"exploring: the flange turns by {angle_deg:g} degrees about its {axis}"
            await self.log.took(E.PLANNED, planning=replace(self._at.planning, note=note), stations=self._at.stations)
            seen = (await self._visit(robot, pose)).detection is not None
            exploration = exploration.after(turn, seen)
        if not exploration.is_complete:
            raise TargetNotSeen(
                f"the target left the picture in {len(exploration.tried)} small turns of the flange",
                "bring the target nearer to the middle of the picture, or state flange_T_camera_guess",
            )

    async def _possible(self, robot: Robot, base_T_flange: Array) -> bool:
        joints = await robot.read_joints() if self.route.rules.arm else None
        try:
            self.route.rules.require_allowed((TaughtPose.of(base_T_flange),), joints)
        except PoseRefused:
            return False
        return True

    async def _next(self, robot: Robot) -> NextView:
        """What has been learnt decides; a thread works it out."""
        rules, at = self.route.rules, self._at
        joints = await robot.read_joints() if rules.arm else None
        here = (await robot.read_pose()).base_T_flange
        problem = self.session.problem(at.views)
        try:
            return await self.workers.run(
                next_view, self.route.guess, problem, self.route.limits, at.wish,
                base_T_flange_now=here, reachable=rules.reachable_from(joints), misses=at.misses, prepared=at.foreseen,
            )  # fmt: skip
        except PlanningError as error:
            raise NoPoses(error.what, error.fix) from None
        except UndeterminedError as error:
            raise TargetNotSeen(error.what, error.fix) from None

    async def _visit_foreseeing(self, robot: Robot, found: NextView) -> View:
        """While the arm moves to the next view, a thread plans what will follow it."""
        rules, at, pose = self.route.rules, self._at, found.base_T_flange
        assert pose is not None
        joints = await robot.read_joints() if rules.arm else None
        reachable = None if rules.arm is None or joints is None else reachable_by(rules.arm, joints)
        problem = self.session.problem(at.views)
        ahead = asyncio.create_task(
            self.workers.run(plan_ahead, found, problem, self.route.limits, at.wish, reachable=reachable)
        )
        try:
            view = await self._visit(robot, pose)
            at.foreseen = await ahead
        finally:
            ahead.cancel()
        return view

    async def _visit(self, robot: Robot, base_T_flange: Array) -> View:
        goal = await self.route.rules.goal(self.log.run.station + 1, TaughtPose.of(base_T_flange), robot)
        await self.cell.move_to(goal)
        await self.log.took(E.ARRIVED)
        return await self._capture(captured=True, sent=goal.base_T_flange)

    async def _capture(self, *, captured: bool, sent: Array | None = None) -> View:
        reading = await self.cell.settled_pose()
        if sent is not None:
            require_arrived(sent, reading, self.cell.robot.capabilities.pose_convention)
        await self.log.took(E.SETTLED)
        index = await self.session.add(await self.cell.picture(reading), reading)
        self._at.planning = replace(self._at.planning, pictures=index + 1)
        await self.log.took(E.LOOKED, planning=self._at.planning, captured=captured)
        view = await self.session.view(index)
        self._at.views.append(view)
        return view

    async def _told(self, event: E, found: NextView) -> None:
        self._at.planning = replace(
            self._at.planning, now_mm=found.now_mm, planned_mm=found.planned_mm, ahead=found.planned_views
        )
        await self.log.took(event, planning=self._at.planning, stations=self._at.stations)

    def _missed(self) -> None:
        """A planned view without the target is taken again from elsewhere, with more doubt."""
        self._at.misses += 1
        self._at.stations += 1
        if self._at.misses > MOST_MISSES:
            require_seen(self._at.views, len(self._at.views))
