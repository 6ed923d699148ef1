"""Manual pose sequence: the operator jogs the arm and requests each view, and is advised where to go next.

The robot is only read, so a driver that only reads is sufficient; it is armed and moved for a jog that the operator
asks the run for, and for nothing else.
"""

from dataclasses import replace

from calibration.closed_forms.observability import SAME_POSE_MM, SAME_POSE_RAD
from calibration.documents.pose import PoseDocument
from calibration.planning.jog_advice import Advice, advise
from calibration.problem import Problem, View
from calibration.sentences.sentence import Sentence
from calibration.transforms import difference
from daemon.cell.cell import Cell
from daemon.errors import CellNotReady, DaemonError, SamePose, StorageError, TargetNotSeen, TooFewViews
from daemon.model.records import Planning, ShiftDocument, TurnDocument
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


class ManualSequence:
    """Poses to which an operator jogs the arm. Holds the cell, and arms the robot for the operator's jogs only."""

    def __init__(
        self,
        planning: AdaptiveParameters,
        requests: OperatorRequestQueue,
        cell: Cell,
        workers: Workers,
        session: SessionWriter,
        log: RunLog,
    ) -> None:
        self._parameters, self._requests = planning, requests
        self._cell, self._workers, self._session, self._log = cell, workers, session, log
        self._views: list[View] = []
        self._planning = Planning(goal=goal_of(planning.wish))

    @property
    def _views_with_target(self) -> list[View]:
        return [view for view in self._views if view.detection is not None]

    async def run(self, min_views: int) -> Problem:
        """As PoseSequence: takes a view for each request until the operator ends it. Raises OperatorTimeout too."""
        try:
            async with self._cell.hold(Sentence("holder-run", run=self._log.id)):
                while not await self._serve(await self._requests.next(), min_views):
                    pass
        finally:
            self._requests.close()
        await self._log.advance(RunState.SOLVING)
        return self._session.problem(self._views)

    async def _serve(self, asked: OperatorRequest, min_views: int) -> bool:
        """Carry out one request; returns True when it ends the sequence. A refused one leaves the run as it was."""
        try:
            if asked.action == "the end":
                if (seen := len(self._views_with_target)) < min_views:
                    what = Sentence("views-are-missing", seen=seen, needed=min_views)
                    raise TooFewViews(what, self._planning.advice or BEGIN)
                await self._log.advance(RunState.DETECTING, stations=self._log.run.station)
            elif asked.jog is not None:
                await self._jog(asked.jog)
            else:
                await self._take_view()
        except StorageError as error:
            asked.refuse(error)
            raise
        except (DaemonError, DeviceError) as error:
            if self._log.run.state is not RunState.WAITING:
                await self._log.advance(RunState.WAITING, planning=self._planning)
            asked.refuse(error)
            return False
        asked.complete()
        return asked.action == "the end"

    async def _jog(self, jog: Jog) -> None:
        """Move the arm, which is stopped and disarmed afterwards in every case."""
        if reasons := await self._cell.robot_obstacles():
            await self._cell.require_interlocks()
            raise CellNotReady(reasons)
        await jog.goal()
        await self._log.advance(RunState.MOVING)
        await jog.carry_out_as_holder()
        await self._log.advance(RunState.WAITING)

    async def _take_view(self) -> None:
        await self._log.advance(RunState.SETTLING)
        reading = await self._cell.read_standing_pose()
        self._check_new_pose(reading)
        await self._log.advance(RunState.CAPTURING)
        index = await self._session.add(await self._cell.capture_frame(reading), reading, self._log.timestamp())
        self._planning = replace(self._planning, pictures=index + 1)
        await self._log.advance(RunState.PLANNING, planning=self._planning)
        view = await self._session.view(index)
        self._views.append(view)
        if view.detection is None:
            raise TargetNotSeen(
                Sentence("target-not-seen-here", why=why_missing(view)),
                Sentence("look-and-jog-on", run=self._log.id, view=index),
            )
        advice = await self._advice(reading)
        steps: list[TurnDocument | ShiftDocument] = [TurnDocument(*turn) for turn in advice.turns]
        if advice.shift_mm is not None:
            steps.append(ShiftDocument(tuple(advice.shift_mm.round(3).tolist())))
        station, at, ahead = self._log.run.station + 1, self._log.timestamp(), int(advice.planned_mm is not None)
        self._planning = replace(
            self._planning.predicting(station, at, advice.now_mm, advice.planned_mm, ahead),
            advice=advice.instruction,
            advice_steps=tuple(steps),
            next_pose=None if advice.base_T_flange is None else PoseDocument.of(advice.base_T_flange),
            next_outline_px=None
            if advice.outline_px is None
            else [(u, v) for u, v in advice.outline_px.round(2).tolist()],
        )
        stations = max(self._log.run.stations, self._log.run.station + 1)
        await self._log.advance(RunState.WAITING, planning=self._planning, stations=stations, captured=True)

    def _check_new_pose(self, reading: PoseReading) -> None:
        for view in self._views_with_target:
            if self._session.axis_moved_since(view.index, reading):
                continue
            off_mm, off_rad = difference(view.base_T_flange, reading.base_T_flange)
            if off_mm < SAME_POSE_MM and off_rad < SAME_POSE_RAD:
                raise SamePose(
                    Sentence("stands-at-view", number=view.index + 1, off_mm=off_mm),
                    self._planning.advice or Sentence("jog-on-and-turn"),
                )

    async def _advice(self, reading: PoseReading) -> Advice:
        planning = self._parameters
        joints = await self._cell.robot.read_joints() if planning.rules.arm else None
        views_left = max(planning.wish.views_left - len(self._views_with_target), 0)
        return await self._workers.run(
            advise, self._session.guess_here(planning.guess), self._session.problem_here(self._views),
            planning.limits, replace(planning.wish, views_left=views_left),
            base_T_flange_now=reading.base_T_flange, reachable=planning.rules.reachable_from(joints),
        )  # fmt: skip
