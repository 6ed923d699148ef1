"""Manual pose sequence: the operator jogs the arm and requests each view, and is advised where to go next.

The robot is only read, so a driver that only reads is sufficient; it is armed and moved for a jog that the operator
asks the run for, and for nothing else.
"""

from dataclasses import dataclass, field, replace

from calibration.closed_forms.observability import SAME_POSE_MM, SAME_POSE_RAD
from calibration.documents.pose import PoseDocument
from calibration.planning.jog_advice import Advice, advise
from calibration.problem import Problem, View
from calibration.sentences.sentence import Sentence
from calibration.transforms import difference
from daemon.cell.cell import Cell
from daemon.errors import CellNotReady, DaemonError, OperatorTimeout, SamePose, StorageError, TargetNotSeen, TooFewViews
from daemon.model.records import Planning, ShiftDocument, TurnDocument
from daemon.model.run_states import RunEvent as E
from daemon.model.run_states import RunState
from daemon.runs.adaptive_sequence import AdaptiveParameters, goal_of
from daemon.runs.jog import Jog
from daemon.runs.operator_requests import OperatorRequest, OperatorRequestQueue
from daemon.runs.pose_sequence import why_missing
from daemon.runs.run_log import RunLog
from daemon.runtime.workers import Workers
from daemon.sessions.session_writer import SessionWriter
from drivers.errors import DeviceError
from drivers.interfaces import PoseReading

BEGIN = "jog the arm to where the camera sees the whole target, let it stand, and take the first picture"


@dataclass(frozen=True)
class ManualParameters:
    """Parameters of a manual sequence: planning, the operator's requests, and how long to wait for each."""

    adaptive: AdaptiveParameters
    requests: OperatorRequestQueue
    wait_s: float


@dataclass
class _Progress:
    views: list[View] = field(default_factory=list)
    planning: Planning = field(default_factory=Planning)

    @property
    def views_with_target(self) -> list[View]:
        return [view for view in self.views if view.detection is not None]


@dataclass(frozen=True)
class ManualSequence:
    """Poses to which an operator jogs the arm. Holds the cell, and arms the robot for the operator's jogs only."""

    parameters: ManualParameters
    cell: Cell
    workers: Workers
    session: SessionWriter
    log: RunLog
    _progress: _Progress = field(default_factory=_Progress, init=False)

    async def run(self, min_views: int) -> Problem:
        """As PoseSequence: takes a view for each request until the operator ends it. Raises OperatorTimeout too."""
        self._progress.planning = Planning(goal=goal_of(self.parameters.adaptive.wish))
        try:
            async with self.cell.hold(Sentence("holder-run", run=self.log.id)):
                while not await self._serve(await self._next_request(), min_views):
                    pass
        finally:
            self.parameters.requests.close()
        await self.log.advance(E.DETECTED)
        return self.session.problem(self._progress.views)

    async def _next_request(self) -> OperatorRequest:
        try:
            return await self.parameters.requests.next(self.parameters.wait_s)
        except TimeoutError:
            what = Sentence("nobody-asked", limit_s=self.parameters.wait_s)
            raise OperatorTimeout(what, Sentence("start-when-somebody-is-there")) from None

    async def _serve(self, asked: OperatorRequest, min_views: int) -> bool:
        """Carry out one request; returns True when it ends the sequence. A refused one leaves the run as it was."""
        try:
            if asked.action == "the end":
                if (seen := len(self._progress.views_with_target)) < min_views:
                    what = Sentence("views-are-missing", seen=seen, needed=min_views)
                    raise TooFewViews(what, self._progress.planning.advice or BEGIN)
                await self.log.advance(E.ENOUGH, stations=self.log.run.station)
            elif asked.jog is not None:
                await self._jog(asked.jog)
            else:
                await self._take_view()
        except StorageError as error:
            asked.refuse(error)
            raise
        except (DaemonError, DeviceError) as error:
            if self.log.run.state is not RunState.WAITING:
                await self.log.advance(E.REFUSED, planning=self._progress.planning)
            asked.refuse(error)
            return False
        asked.complete()
        return asked.action == "the end"

    async def _jog(self, jog: Jog) -> None:
        """Move the arm, which is stopped and disarmed afterwards in every case."""
        if reasons := await self.cell.robot_obstacles():
            await self.cell.require_interlocks()
            raise CellNotReady(reasons)
        await jog.goal()
        await self.log.advance(E.JOGS)
        await jog.carry_out_as_holder()
        await self.log.advance(E.JOGGED)

    async def _take_view(self) -> None:
        await self.log.advance(E.ASKED)
        reading = await self.cell.read_standing_pose()
        self._check_new_pose(reading)
        await self.log.advance(E.SETTLED)
        index = await self.session.add(await self.cell.capture_frame(reading), reading, self.log.timestamp())
        self._progress.planning = replace(self._progress.planning, pictures=index + 1)
        await self.log.advance(E.LOOKED, planning=self._progress.planning)
        view = await self.session.view(index)
        self._progress.views.append(view)
        if view.detection is None:
            raise TargetNotSeen(
                Sentence("target-not-seen-here", why=why_missing(view)),
                Sentence("look-and-jog-on", run=self.log.id, view=index),
            )
        advice = await self._advice(reading)
        steps: list[TurnDocument | ShiftDocument] = [TurnDocument(*turn) for turn in advice.turns]
        if advice.shift_mm is not None:
            steps.append(ShiftDocument(tuple(advice.shift_mm.round(3).tolist())))
        station, at, ahead = self.log.run.station + 1, self.log.timestamp(), int(advice.planned_mm is not None)
        self._progress.planning = replace(
            self._progress.planning.predicting(station, at, advice.now_mm, advice.planned_mm, ahead),
            advice=advice.instruction,
            advice_steps=tuple(steps),
            next_pose=None if advice.base_T_flange is None else PoseDocument.of(advice.base_T_flange),
            next_outline_px=None
            if advice.outline_px is None
            else [(u, v) for u, v in advice.outline_px.round(2).tolist()],
        )
        stations = max(self.log.run.stations, self.log.run.station + 1)
        await self.log.advance(E.ADVISED, planning=self._progress.planning, stations=stations, captured=True)

    def _check_new_pose(self, reading: PoseReading) -> None:
        for view in self._progress.views_with_target:
            if self.session.axis_moved_since(view.index, reading):
                continue
            off_mm, off_rad = difference(view.base_T_flange, reading.base_T_flange)
            if off_mm < SAME_POSE_MM and off_rad < SAME_POSE_RAD:
                raise SamePose(
                    Sentence("stands-at-view", number=view.index + 1, off_mm=off_mm),
                    self._progress.planning.advice or Sentence("jog-on-and-turn"),
                )

    async def _advice(self, reading: PoseReading) -> Advice:
        planning = self.parameters.adaptive
        joints = await self.cell.robot.read_joints() if planning.rules.arm else None
        views_left = max(planning.wish.views_left - len(self._progress.views_with_target), 0)
        return await self.workers.run(
            advise, self.session.guess_here(planning.guess), self.session.problem_here(self._progress.views),
            planning.limits, replace(planning.wish, views_left=views_left),
            base_T_flange_now=reading.base_T_flange, reachable=planning.rules.reachable_from(joints),
        )  # fmt: skip
