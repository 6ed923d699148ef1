"""Adaptive pose sequence: take a view, update the scene belief, plan the next pose, move; until X is known well.

`foresee` computes the poses that a run would take, and what they would tell, without moving anything.
"""

import asyncio
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calibration.documents.external_axis import FoundAxisDocument, external_axes_of
from calibration.documents.pose import PoseDocument
from calibration.errors import UndeterminedError
from calibration.kinematics.arm import Arm
from calibration.likelihood.predicted_uncertainty import predict
from calibration.planning.exploration import Exploration, turn_flange
from calibration.planning.line_of_sight import LineOfSight, line_of_sight
from calibration.planning.next_view import NextView, StoppingRule, next_view, plan_ahead
from calibration.planning.plan import Plan, PlanningError
from calibration.planning.scene_belief import SceneBelief, ScenePrior, default_camera
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
from daemon.model.run_states import RunState
from daemon.runs.pose_sequence import check_detections, why_missing
from daemon.runs.run_log import RunLog
from daemon.runtime.workers import Workers
from daemon.sessions.session_writer import SessionWriter
from drivers.interfaces import PoseReading, Robot

MAX_MISSES = 3
"""The run fails when the target was not found in more planned views than this."""

UNKNOWN_SCENE = "the first pictures of the run are small turns from where the arm stands: they find the camera's place"


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


class AdaptiveSequence:
    """Poses planned after each view. Arms the robot on entry; it is left stopped and disarmed in every case."""

    def __init__(
        self, parameters: AdaptiveParameters, cell: Cell, workers: Workers, session: SessionWriter, log: RunLog
    ) -> None:
        self._parameters, self._cell, self._workers = parameters, cell, workers
        self._session, self._log = session, log
        self._views: list[View] = []
        self._wish, self._stations, self._misses = parameters.wish, parameters.wish.views_left, 0
        self._planning = Planning(note=parameters.assumed, goal=goal_of(parameters.wish))
        self._foreseen: Plan | None = None
        self._belief: SceneBelief | None = None

    async def run(self, min_views: int) -> Problem:
        """As PoseSequence; raises NoPoses and PoseRefused too."""
        async with self._cell.motion_lease(Sentence("holder-run", run=self._log.id)) as robot:
            await self._capture_first_view()
            await self._explore(robot)
            while (found := await self._plan_next(robot)).base_T_flange is not None:
                await self._log_plan(RunState.MOVING, found)
                if (await self._visit_and_plan_ahead(robot, found)).detection is not None:
                    self._wish = replace(self._wish, views_left=self._wish.views_left - 1)
                else:
                    self._misses += 1
                    self._stations += 1
                    if self._misses > MAX_MISSES:
                        check_detections(self._views, max(min_views, len(self._views) - MAX_MISSES))
            self._stations = self._log.run.station
            await self._log_plan(RunState.DETECTING, found)
        check_detections(self._views, min_views)
        await self._log.advance(RunState.SOLVING)
        return self._session.problem(self._views)

    async def _capture_first_view(self) -> None:
        """Take the first view from where the arm stands, without moving it."""
        await self._log.advance(RunState.SETTLING)
        view = await self._capture(captured=False)
        guess = self._parameters.guess
        if view.detection is None and (guess.mount_T_camera is None or guess.anchor_T_target is None):
            raise TargetNotSeen(Sentence("target-not-seen-at-start", why=why_missing(view)), Sentence("bring-in-view"))

    async def _explore(self, robot: Robot) -> None:
        """Turn the flange by small angles to find the camera's place on it, when no guess is given."""
        if self._parameters.guess.mount_T_camera is not None:
            return
        start, exploration = self._views[0].base_T_flange, Exploration()
        while (turn := exploration.next_turn()) is not None:
            pose = turn_flange(start, turn)
            if not await self._is_reachable(robot, pose):
                exploration = exploration.after(turn, seen=False)
                continue
            axis, angle_deg = turn
            self._stations += 1
            note = f"exploring: the flange turns by {angle_deg:g} degrees about its {axis}"
            await self._log.advance(
                RunState.MOVING, planning=replace(self._planning, note=note), stations=self._stations
            )
            seen = (await self._visit(robot, pose)).detection is not None
            exploration = exploration.after(turn, seen)
        if not exploration.is_complete:
            what = Sentence("target-left-picture", turns=len(exploration.tried))
            setting = f"{MOUNTS[self._parameters.guess.setup]}_T_camera_guess"
            raise TargetNotSeen(what, Sentence("bring-nearer-to-middle", setting=setting))

    async def _is_reachable(self, robot: Robot, base_T_flange: Array) -> bool:
        joints = await robot.read_joints() if self._parameters.rules.arm else None
        try:
            await self._workers.run(self._parameters.rules.check_poses, (TaughtPose.of(base_T_flange),), joints)
        except PoseRefused:
            return False
        return True

    def _sight(self) -> LineOfSight | None:
        """As the newest belief has camera and target, else as the guesses have them."""
        known = self._belief.scene if self._belief else self._parameters.guess
        if known.mount_T_camera is None or known.anchor_T_target is None:
            return None
        return line_of_sight(known.setup, known.target, known.mount_T_camera, known.anchor_T_target)

    async def _plan_next(self, robot: Robot) -> NextView:
        """Plan the next view in a worker thread."""
        rules = self._parameters.rules
        joints = await robot.read_joints() if rules.arm else None
        here = (await robot.read_pose()).base_T_flange
        problem = self._session.problem_here(self._views)
        try:
            found: NextView = await self._workers.run(
                next_view, self._parameters.guess, problem, self._parameters.limits, self._wish,
                base_T_flange_now=here, reachable=rules.reachable_from(joints, self._sight()), misses=self._misses,
                prepared=self._foreseen,
            )  # fmt: skip
        except PlanningError as error:
            raise NoPoses(error.what, error.fix) from None
        except UndeterminedError as error:
            raise TargetNotSeen(error.what, error.fix) from None
        self._belief = found.belief
        return found

    async def _visit_and_plan_ahead(self, robot: Robot, found: NextView) -> View:
        """Move to the next view, and plan the one after it in a worker thread at the same time."""
        rules, pose = self._parameters.rules, found.base_T_flange
        assert pose is not None
        joints = await robot.read_joints() if rules.arm else None
        problem = self._session.problem_here(self._views)
        ahead = asyncio.create_task(
            self._workers.run(_plan_from_there, self._parameters, found, problem, self._wish, joints, self._sight())
        )
        try:
            view = await self._visit(robot, pose)
            self._foreseen = await ahead
        finally:
            ahead.cancel()
        return view

    async def _visit(self, robot: Robot, base_T_flange: Array) -> View:
        goal = await self._parameters.rules.goal(self._log.run.station + 1, TaughtPose.of(base_T_flange), robot)
        await self._cell.move_to(goal)
        await self._log.advance(RunState.SETTLING)
        return await self._capture(captured=True, sent=goal.base_T_flange)

    async def _capture(self, *, captured: bool, sent: Array | None = None) -> View:
        reading = await self._cell.read_settled_pose()
        if sent is not None:
            check_arrival(sent, reading, self._cell.robot.capabilities.pose_convention)
        await self._log.advance(RunState.CAPTURING)
        index = await self._session.add(await self._cell.capture_frame(reading), reading, self._log.timestamp())
        self._planning = replace(self._planning, pictures=index + 1)
        await self._log.advance(RunState.PLANNING, planning=self._planning, captured=captured)
        view = await self._session.view(index)
        self._views.append(view)
        return view

    async def _log_plan(self, state: RunState, found: NextView) -> None:
        planning, run = self._planning, self._log.run
        planning = planning.predicting(
            run.station, self._log.timestamp(), found.now_mm, found.planned_mm, found.planned_views
        )
        note = self._parameters.assumed if found.reach is None else str(found.reach.sentence())
        rules = self._parameters.rules
        poses: tuple[PlannedPoseDocument, ...] = ()
        if found.planned is not None:
            joints = await self._cell.robot.read_joints() if rules.arm else None
            way = found.planned
            poses = await self._workers.run(lambda: tuple(draw_poses(rules.arm, way, rules.joints_along(way, joints))))
        self._planning = replace(planning, planned_poses=poses, note=note)
        await self._log.advance(state, planning=self._planning, stations=self._stations)


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


def draw_poses(
    arm: Arm | None, base_T_flange: Array, along_rad: Sequence[Array | None]
) -> Iterator[PlannedPoseDocument]:
    """The poses (n, 4, 4) as documents, with joints (6,) and skeleton at each where they are known."""
    for pose, joints_rad in zip(base_T_flange, along_rad, strict=True):
        joints_deg = None if joints_rad is None else [round(float(angle), 4) for angle in np.degrees(joints_rad)]
        yield PlannedPoseDocument(PoseDocument.of(pose), joints_deg, skeleton_mm(arm, joints_rad))


@dataclass(frozen=True, eq=False)
class Foresight:
    """The poses base_T_flange (n, 4, 4), joints (6,) at each where known, and what U (k = 2, mm) would be after each.

    `predicted_mm`: at the worst of the points that matter; None before the views determine X. `note`: what was assumed,
    or why nothing is planned yet.
    """

    base_T_flange: Array
    joints_rad: list[Array | None]
    predicted_mm: tuple[float | None, ...]
    note: str


def foresee_taught(rules: MotionRules, poses: tuple[TaughtPose, ...], joints_now_rad: Array | None) -> Foresight:
    """What a run would do with these poses. Raises PoseRefused."""
    rules.check_poses(poses, joints_now_rad)
    taught = np.array([pose.transform() for pose in poses])
    return Foresight(taught, rules.joints_along(taught, joints_now_rad), (None,) * len(poses), "")


def foresee(parameters: AdaptiveParameters, base_T_flange_now: Array, joints_now_rad: Array | None) -> Foresight:
    """Plan the next poses of an adaptive run before its first view, as the run would after it. Raises NoPoses."""
    prior, rules = parameters.guess, parameters.rules
    lens = prior.camera or prior.lens_before or default_camera()
    try:
        nothing_seen = Problem(prior.setup, prior.target, prior.camera, lens.image_size, ())
        found = next_view(
            prior, nothing_seen, parameters.limits, parameters.wish, base_T_flange_now=base_T_flange_now,
            reachable=rules.reachable_from(joints_now_rad),
        )  # fmt: skip
    except UndeterminedError:
        return Foresight(np.empty((0, 4, 4)), [], (), UNKNOWN_SCENE)
    except PlanningError as error:
        raise NoPoses(error.what, error.fix) from None
    poses, belief = found.planned, found.belief
    assert poses is not None  # no views are left to take only with a wish for none
    assert belief is not None
    along = rules.joints_along(poses, joints_now_rad)
    predicted_mm = tuple(predict(belief.scene, poses[: count + 1]).expanded_mm for count in range(len(poses)))
    return Foresight(poses, along, predicted_mm, parameters.assumed)
