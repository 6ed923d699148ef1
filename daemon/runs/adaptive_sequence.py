"""Adaptive pose sequence: take a view, update the scene belief, plan the next pose, move; until X is known well."""

import asyncio
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from calibration.documents.external_axis import FoundAxisDocument, external_axes_of
from calibration.documents.pose import PoseDocument
from calibration.errors import UndeterminedError
from calibration.kinematics.arm import Arm
from calibration.planning.exploration import Exploration, turn_flange
from calibration.planning.line_of_sight import LineOfSight, line_of_sight
from calibration.planning.next_view import NextView, StoppingRule, next_view, plan_ahead
from calibration.planning.plan import Plan, PlanningError
from calibration.planning.scene_belief import SceneBelief, ScenePrior
from calibration.planning.viewpoints import ViewpointLimits
from calibration.problem import MOUNTS, Problem, View
from calibration.sentences.sentence import Sentence
from calibration.transforms import Array
from daemon.cell.cell import Cell
from daemon.cell.motion_rules import MotionRules
from daemon.cell.settling import check_arrival
from daemon.cell.skeleton import skeleton_mm
from daemon.config.settings import TaughtPose
from daemon.errors import NoPoses, PoseRefused, TargetNotSeen
from daemon.model.records import GoalDocument, PlannedPoseDocument, Planning
from daemon.model.run_states import RunEvent as E
from daemon.runs.pose_sequence import check_detections, why_missing
from daemon.runs.run_log import RunLog
from daemon.runtime.workers import Workers
from daemon.sessions.session_writer import SessionWriter
from drivers.interfaces import PoseReading, Robot

MAX_MISSES = 3
"""The run fails when the target was not found in more planned views than this."""


@dataclass(frozen=True)
class AdaptiveParameters:
    """Parameters of an adaptive sequence. The stopping rule's `views_left` does not count the first look."""

    guess: ScenePrior
    limits: ViewpointLimits
    wish: StoppingRule
    rules: MotionRules
    assumed: str = ""

    def at_reading(self, axis: FoundAxisDocument, here: PoseReading) -> "AdaptiveParameters":
        """With the guess in the base where it stands now."""
        reading = axis.reading(external_axes_of(here.external_axes))
        return self if reading is None else replace(self, guess=self.guess.at_reading(axis.axis(), reading))


def goal_of(wish: StoppingRule) -> GoalDocument:
    """What ends the run: a number of views, or what is known by then."""
    return GoalDocument(wish.views_left, wish.uncertainty_mm, wish.tolerance_mm)


@dataclass
class _Progress:
    views: list[View] = field(default_factory=list)
    wish: StoppingRule = field(default_factory=lambda: StoppingRule(0))
    stations: int = 0
    misses: int = 0
    foreseen: Plan | None = None
    belief: SceneBelief | None = None
    planning: Planning = field(default_factory=Planning)


@dataclass(frozen=True)
class AdaptiveSequence:
    """Poses planned after each view. Arms the robot on entry; it is left stopped and disarmed in every case."""

    parameters: AdaptiveParameters
    cell: Cell
    workers: Workers
    session: SessionWriter
    log: RunLog
    _progress: _Progress = field(default_factory=_Progress, init=False)

    async def run(self, min_views: int) -> Problem:
        """As PoseSequence; raises NoPoses and PoseRefused too."""
        self._progress.wish, self._progress.stations = self.parameters.wish, self.parameters.wish.views_left
        self._progress.planning = Planning(note=self.parameters.assumed, goal=goal_of(self.parameters.wish))
        async with self.cell.motion_lease(Sentence("holder-run", run=self.log.id)) as robot:
            await self._capture_first_view()
            await self._explore(robot)
            while (found := await self._plan_next(robot)).base_T_flange is not None:
                await self._log_plan(E.PLANNED, found)
                if (await self._visit_and_plan_ahead(robot, found)).detection is not None:
                    self._progress.wish = replace(self._progress.wish, views_left=self._progress.wish.views_left - 1)
                else:
                    self._progress.misses += 1
                    self._progress.stations += 1
                    if self._progress.misses > MAX_MISSES:
                        check_detections(self._progress.views, max(min_views, len(self._progress.views) - MAX_MISSES))
            self._progress.stations = self.log.run.station
            await self._log_plan(E.ENOUGH, found)
        check_detections(self._progress.views, min_views)
        await self.log.advance(E.DETECTED)
        return self.session.problem(self._progress.views)

    async def _capture_first_view(self) -> None:
        """Take the first view from where the arm stands, without moving it."""
        await self.log.advance(E.ARRIVED)
        view = await self._capture(captured=False)
        guess = self.parameters.guess
        if view.detection is None and (guess.mount_T_camera is None or guess.anchor_T_target is None):
            raise TargetNotSeen(Sentence("target-not-seen-at-start", why=why_missing(view)), Sentence("bring-in-view"))

    async def _explore(self, robot: Robot) -> None:
        """Turn the flange by small angles to find the camera's place on it, when no guess is given."""
        if self.parameters.guess.mount_T_camera is not None:
            return
        start, exploration = self._progress.views[0].base_T_flange, Exploration()
        while (turn := exploration.next_turn()) is not None:
            pose = turn_flange(start, turn)
            if not await self._is_reachable(robot, pose):
                exploration = exploration.after(turn, seen=False)
                continue
            axis, angle_deg = turn
            self._progress.stations += 1
            note = f"exploring: the flange turns by {angle_deg:g} degrees about its {axis}"
            await self.log.advance(
                E.PLANNED, planning=replace(self._progress.planning, note=note), stations=self._progress.stations
            )
            seen = (await self._visit(robot, pose)).detection is not None
            exploration = exploration.after(turn, seen)
        if not exploration.is_complete:
            what = Sentence("target-left-picture", turns=len(exploration.tried))
            setting = f"{MOUNTS[self.parameters.guess.setup]}_T_camera_guess"
            raise TargetNotSeen(what, Sentence("bring-nearer-to-middle", setting=setting))

    async def _is_reachable(self, robot: Robot, base_T_flange: Array) -> bool:
        joints = await robot.read_joints() if self.parameters.rules.arm else None
        try:
            await self.workers.run(self.parameters.rules.check_poses, (TaughtPose.of(base_T_flange),), joints)
        except PoseRefused:
            return False
        return True

    def _sight(self) -> LineOfSight | None:
        """As the newest belief has camera and target, else as the guesses have them."""
        known = self._progress.belief.scene if self._progress.belief else self.parameters.guess
        if known.mount_T_camera is None or known.anchor_T_target is None:
            return None
        return line_of_sight(known.setup, known.target, known.mount_T_camera, known.anchor_T_target)

    async def _plan_next(self, robot: Robot) -> NextView:
        """Plan the next view in a worker thread."""
        rules, at = self.parameters.rules, self._progress
        joints = await robot.read_joints() if rules.arm else None
        here = (await robot.read_pose()).base_T_flange
        problem = self.session.problem_here(at.views)
        try:
            found: NextView = await self.workers.run(
                next_view, self.parameters.guess, problem, self.parameters.limits, at.wish,
                base_T_flange_now=here, reachable=rules.reachable_from(joints, self._sight()), misses=at.misses,
                prepared=at.foreseen,
            )  # fmt: skip
        except PlanningError as error:
            raise NoPoses(error.what, error.fix) from None
        except UndeterminedError as error:
            raise TargetNotSeen(error.what, error.fix) from None
        at.belief = found.belief
        return found

    async def _visit_and_plan_ahead(self, robot: Robot, found: NextView) -> View:
        """Move to the next view, and plan the one after it in a worker thread at the same time."""
        rules, at, pose = self.parameters.rules, self._progress, found.base_T_flange
        assert pose is not None
        joints = await robot.read_joints() if rules.arm else None
        problem = self.session.problem_here(at.views)
        ahead = asyncio.create_task(
            self.workers.run(_plan_from_there, self.parameters, found, problem, at.wish, joints, self._sight())
        )
        try:
            view = await self._visit(robot, pose)
            at.foreseen = await ahead
        finally:
            ahead.cancel()
        return view

    async def _visit(self, robot: Robot, base_T_flange: Array) -> View:
        goal = await self.parameters.rules.goal(self.log.run.station + 1, TaughtPose.of(base_T_flange), robot)
        await self.cell.move_to(goal)
        await self.log.advance(E.ARRIVED)
        return await self._capture(captured=True, sent=goal.base_T_flange)

    async def _capture(self, *, captured: bool, sent: Array | None = None) -> View:
        reading = await self.cell.read_settled_pose()
        if sent is not None:
            check_arrival(sent, reading, self.cell.robot.capabilities.pose_convention)
        await self.log.advance(E.SETTLED)
        index = await self.session.add(await self.cell.capture_frame(reading), reading, self.log.timestamp())
        self._progress.planning = replace(self._progress.planning, pictures=index + 1)
        await self.log.advance(E.LOOKED, planning=self._progress.planning, captured=captured)
        view = await self.session.view(index)
        self._progress.views.append(view)
        return view

    async def _log_plan(self, event: E, found: NextView) -> None:
        planning, run = self._progress.planning, self.log.run
        planning = planning.predicting(
            run.station, self.log.timestamp(), found.now_mm, found.planned_mm, found.planned_views
        )
        note = self.parameters.assumed if found.reach is None else str(found.reach.sentence())
        rules = self.parameters.rules
        poses: tuple[PlannedPoseDocument, ...] = ()
        if found.planned is not None:
            joints = await self.cell.robot.read_joints() if rules.arm else None
            poses = await self.workers.run(_with_joints, rules, found.planned, joints)
        self._progress.planning = replace(planning, planned_poses=poses, note=note)
        await self.log.advance(event, planning=self._progress.planning, stations=self._progress.stations)


def _plan_from_there(
    parameters: AdaptiveParameters,
    found: NextView,
    problem: Problem,
    wish: StoppingRule,
    joints_now_rad: Array | None,
    sight: LineOfSight | None,
) -> Plan | None:
    """The plan after `found`, within what the arm can do from there."""
    assert found.base_T_flange is not None
    rules = parameters.rules
    (there,) = rules.joints_along(found.base_T_flange[None], joints_now_rad)
    reachable = rules.reachable_from(there, sight)
    return plan_ahead(found, problem, parameters.limits, wish, reachable=reachable)


def _with_joints(
    rules: MotionRules, base_T_flange: Array, joints_now_rad: Array | None
) -> tuple[PlannedPoseDocument, ...]:
    return tuple(draw_poses(rules.arm, base_T_flange, rules.joints_along(base_T_flange, joints_now_rad)))


def draw_poses(
    arm: Arm | None, base_T_flange: Array, along_rad: Sequence[Array | None]
) -> Iterator[PlannedPoseDocument]:
    """The poses (n, 4, 4) as documents, with joints (6,) and skeleton at each where they are known."""
    for pose, joints_rad in zip(base_T_flange, along_rad, strict=True):
        joints_deg = None if joints_rad is None else [round(float(angle), 4) for angle in np.degrees(joints_rad)]
        yield PlannedPoseDocument(PoseDocument.of(pose), joints_deg, skeleton_mm(arm, joints_rad))
