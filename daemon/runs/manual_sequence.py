"""Poses that an operator jogs to: he asks for a view where the arm stands, and is advised where to go next.

Nothing here commands the robot: it is only read, so any driver that reads will do, and none needs to be armed.
"""

from dataclasses import dataclass, field, replace

from calibration.documents.pose import PoseDocument
from calibration.observability import SAME_POSE_MM, SAME_POSE_RAD
from calibration.planning.jog_advice import Advice, advise
from calibration.problem import Problem, View
from calibration.transforms import difference
from daemon.cell.cell import Cell
from daemon.errors import DaemonError, OperatorGone, SamePose, StorageError, TargetNotSeen, TooFewViews
from daemon.model.records import Planning
from daemon.model.run_states import RunEvent as E
from daemon.model.run_states import RunState
from daemon.runs.adaptive_sequence import AdaptiveRoute
from daemon.runs.operator_requests import Asked, Desk
from daemon.runs.run_log import RunLog
from daemon.runtime.workers import Workers
from daemon.sessions.session_writer import SessionWriter
from drivers.errors import DeviceError
from drivers.interfaces import PoseReading

BEGIN = "jog the arm to where the camera sees the whole target, let it stand, and take the first view"


@dataclass(frozen=True)
class ManualRoute:
    """What such a run is given: what is known and wished for, where it is asked, how long it waits for the operator."""

    planning: AdaptiveRoute
    desk: Desk
    wait_s: float


@dataclass
class _Progress:
    views: list[View] = field(default_factory=list)
    planning: Planning = field(default_factory=Planning)

    @property
    def seen(self) -> list[View]:
        return [view for view in self.views if view.detection is not None]


@dataclass(frozen=True)
class ManualSequence:
    """Poses that an operator jogs to. The cell is held, and never armed."""

    route: ManualRoute
    cell: Cell
    workers: Workers
    session: SessionWriter
    log: RunLog
    _at: _Progress = field(default_factory=_Progress, init=False)

    async def run(self, min_views: int) -> Problem:
        """As PoseSequence: every view the operator asks for, until the end is asked for. Raises OperatorGone too."""
        try:
            async with self.cell.held_by(f"run {self.log.id}"):
                while not await self._served(await self._next(), min_views):
                    pass
        finally:
            self.route.desk.close()
        await self.log.took(E.DETECTED)
        return self.session.problem(self._at.views)

    async def _next(self) -> Asked:
        try:
            return await self.route.desk.next(self.route.wait_s)
        except TimeoutError:
            raise OperatorGone(
                f"no view was asked for within {self.route.wait_s:g} s",
                "start again when somebody is at the cell; or allow more in [calibration] manual_wait_s",
            ) from None

    async def _served(self, asked: Asked, min_views: int) -> bool:
        """Whether that was the end. What is refused is told, and leaves the run as it was."""
        try:
            if asked.wish == "the end":
                self._require_enough(min_views)
                await self.log.took(E.ENOUGH, stations=self.log.run.station)
            else:
                await self._take()
        except StorageError as error:
            asked.refuse(error)
            raise
        except (DaemonError, DeviceError) as error:
            if self.log.run.state is not RunState.WAITING:
                await self.log.took(E.REFUSED, planning=self._at.planning)
            asked.refuse(error)
            return False
        asked.grant()
        return asked.wish == "the end"

    def _require_enough(self, min_views: int) -> None:
        if (seen := len(self._at.seen)) < min_views:
            raise TooFewViews(
                f"{seen} views show the target, {min_views} are needed", self._at.planning.advice or BEGIN
            )

    async def _take(self) -> None:
        await self.log.took(E.ASKED)
        reading = await self.cell.standing_pose()
        self._require_elsewhere(reading)
        await self.log.took(E.SETTLED)
        index = await self.session.add(await self.cell.picture(reading), reading)
        self._at.planning = replace(self._at.planning, pictures=index + 1)
        await self.log.took(E.LOOKED, planning=self._at.planning)
        view = await self.session.view(index)
        self._at.views.append(view)
        _require_target(view, self.log.id)
        advice = await self._advice(reading)
        self._at.planning = replace(
            self._at.planning,
            now_mm=advice.now_mm,
            planned_mm=advice.planned_mm,
            ahead=int(advice.planned_mm is not None),
            advice=advice.instruction,
            next_pose=None if advice.base_T_flange is None else PoseDocument.of(advice.base_T_flange).model_dump(),
        )
        stations = max(self.log.run.stations, self.log.run.station + 1)
        await self.log.took(E.ADVISED, planning=self._at.planning, stations=stations, captured=True)

    def _require_elsewhere(self, reading: PoseReading) -> None:
        for number, view in enumerate(self._at.seen, start=1):
            off_mm, off_rad = difference(view.base_T_flange, reading.base_T_flange)
            if off_mm < SAME_POSE_MM and off_rad < SAME_POSE_RAD:
                raise SamePose(
                    f"the arm stands where view {number} was taken ({off_mm:.2f} mm from there)",
                    self._at.planning.advice or "jog on, and turn the flange",
                )

    async def _advice(self, reading: PoseReading) -> Advice:
        planning = self.route.planning
        joints = await self.cell.robot.read_joints() if planning.rules.arm else None
        wish = replace(planning.wish, views_left=max(planning.wish.views_left - len(self._at.seen), 0))
        return await self.workers.run(
            advise, planning.guess, self.session.problem(self._at.views), planning.limits, wish,
            base_T_flange_now=reading.base_T_flange, reachable=planning.rules.reachable_from(joints),
        )  # fmt: skip


def _require_target(view: View, run_id: str) -> None:
    """Raises TargetNotSeen."""
    if view.detection is None:
        why = view.missing[1] if view.missing else "it was not found"
        raise TargetNotSeen(
            f"the target is not seen from here: {why}",
            f"look at the picture (GET /runs/{run_id}/frames/{view.index}), jog on, and take the view again",
        )
