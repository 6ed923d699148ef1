"""What the rows share: the wire, Robot Web Services, the person, limits, and the moves they make."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np

from calibration.transforms import Array, difference, transform
from drivers.errors import DeviceError, MoveFailed
from drivers.interfaces import MoveGoal, PoseReading
from drivers.robots.abb import cb_wire
from drivers.robots.abb.acceptance.person import KEY, ROOM, Answer, Person, Step
from drivers.robots.abb.acceptance.wire import Wire
from drivers.robots.abb.cb_session import Answered
from drivers.robots.abb.cb_status_errors import MoveMonitor
from drivers.robots.abb.rws.address import RwsAddress
from drivers.robots.abb.rws.administration import RwsAdministration
from drivers.robots.abb.rws.robot import RwsRobot
from drivers.timing import Timing
from drivers.transports.transport import Transport
from protocols.cb.codes import Status
from protocols.cb.messages import GetJoints, GetPose, GetStatus, Joints, Ping, Pose, Refused, Report, Request, SetArmed

Kind = TypeVar("Kind")
POLL_S = 0.02
BEAT_S = 0.5
STILL_MM, STILL_RAD = 0.05, 1e-4


@dataclass(frozen=True)
class AcceptanceLimits:
    """Durations, sizes of the moves, and what is accepted. The defaults take about an hour with a person.

    `repeats`: requests of a row that may be sent again as the answer was late, for a PC that does other work meanwhile;
    `repeats_share`: of `reads`.
    """

    reads: int = 10_000
    samples: int = 200
    repeats: int = 0
    repeats_share: float = 0.001
    idle_s: float = 600.0
    stand_s: float = 5.0
    travel_mm: float = 120.0
    turn_deg: float = 15.0
    slow_mm_s: float = 20.0
    fast_mm_s: float = 100.0
    reach_mm: float = 400.0
    reply_s: float = 0.2
    service_s: float = 0.9
    stop_s: float = 0.5
    silence_s: float = 2.0
    margin_s: float = 0.6
    reconnect_s: float = 120.0
    arrival_mm: float = 0.1
    egm_port: int | None = None


class RowFailed(Exception):
    """The assumption does not hold; the text says what was seen."""


class RowSkipped(Exception):
    """The row could not be tried; the text says why."""


@dataclass
class Bench:
    """One run. `services`: Robot Web Services; None without an address."""

    transport: Transport
    services: RwsAddress | None
    person: Person
    limits: AcceptanceLimits = field(default_factory=AcceptanceLimits)
    timing: Timing = field(default_factory=Timing)
    home: PoseReading | None = None
    choose: str = KEY
    _wire: Wire | None = field(default=None, init=False)

    @asynccontextmanager
    async def wire(self, *, patient: bool = False) -> AsyncIterator[Wire]:
        """A greeted connection, closed politely, and kept alive while the person works; `patient`: as `reconnect`."""
        wire = await self.reconnect(self.limits.reconnect_s if patient else 0.0)
        try:
            yield wire
        finally:
            await self.close(wire)

    async def close(self, wire: Wire, *, politely: bool = True) -> None:
        """Close a connection that `wire` or `reconnect` opened."""
        self._wire = None
        await wire.close(politely=politely)

    @asynccontextmanager
    async def robot_services(self) -> AsyncIterator[RwsRobot]:
        """A connected reader over Robot Web Services. Raises RowSkipped without an address."""
        robot = RwsRobot(self._services(), self.timing)
        robot.start()
        try:
            await robot.wait_for_link(10.0)
            yield robot
        finally:
            await robot.close()

    def administration(self) -> RwsAdministration:
        """A session for options, grants and mastership. Raises RowSkipped without an address."""
        return RwsAdministration(self._services(), self.timing)

    def _services(self) -> RwsAddress:
        if self.services is None:
            raise RowSkipped("no address of Robot Web Services was given")
        return self.services

    async def ask_person(self, step: Step, **shown: object) -> None:
        """Have something done. Raises RowSkipped when the person skips it, RowFailed when the answer is no."""
        beats, text = asyncio.create_task(self._beat()), step.text.format(choose=self.choose, **shown)
        try:
            answer = await self.person.do(replace(step, text=text))
        finally:
            beats.cancel()
            await asyncio.gather(beats, return_exceptions=True)
        if answer is Answer.SKIP or (step.consent and answer is Answer.NO):
            raise RowSkipped("skipped by the person")
        if answer is Answer.NO:
            raise RowFailed(f"the person answers no: {text}")

    async def _beat(self) -> None:
        with suppress(DeviceError):
            while self._wire is not None:
                await self.timing.sleep(BEAT_S)
                await self._wire.ask(Ping())

    # --- reading ---

    async def pose(self, wire: Wire) -> PoseReading:
        """Pose of tool0 in wobj0."""
        exchange = await wire.ask(GetPose())
        return cb_wire.pose_reading(wire.device, self.expect(exchange, Pose), exchange.asked_at_s)

    async def report(self, wire: Wire) -> Report:
        return self.expect(await wire.ask(GetStatus()), Report)

    async def joints_deg(self, wire: Wire) -> Array:
        """Axis angles (6,) in degrees."""
        return np.array(self.expect(await wire.ask(GetJoints()), Joints).axes_deg)

    def expect(self, exchange: Answered, kind: type[Kind]) -> Kind:
        """The answer, of that kind. Raises RowFailed for a refusal."""
        if not isinstance(exchange.reply, kind):
            named = exchange.reply.name if isinstance(exchange.reply, Refused) else type(exchange.reply).__name__
            raise RowFailed(f"{kind.__name__} was expected, and {named} came")
        return exchange.reply

    async def refusal(self, wire: Wire, request: Request) -> str:
        """Name of the status with which a request is refused; "" when it is not."""
        reply = (await wire.ask(request)).reply
        return reply.name if isinstance(reply, Refused) else ""

    # --- moving ---

    async def arm(self, wire: Wire) -> None:
        """Allow motion in this connection."""
        refused = await self.refusal(wire, SetArmed(wire.session, True))
        if refused:
            raise RowFailed(f"arming was refused: {refused}")

    async def go_home(self, wire: Wire) -> PoseReading:
        """Move to where the run began; the first call notes it."""
        here = await self.pose(wire)
        if self.home is None:
            await self.ask_person(ROOM, travel=self.limits.travel_mm, turn=self.limits.turn_deg)
            self.home = here
        elif not self.same(here, self.home):
            await self.arm(wire)
            await self.travel(wire, goal_of(self.home, self.limits.fast_mm_s))
        return self.home

    def away(self, home: PoseReading, speed_mm_s: float) -> MoveGoal:
        """The far end of the slow moves: back along the flange's axis."""
        flange_T_away = transform(np.eye(3), [0.0, 0.0, -self.limits.travel_mm])
        return MoveGoal(home.base_T_flange @ flange_T_away, home.posture, home.external_axes, speed_mm_s, "linear")

    async def begin(self, wire: Wire, goal: MoveGoal) -> int:
        """Send a move; returns its number. Raises RowFailed when it is refused."""
        exchange = await wire.ask(cb_wire.move_of(wire.device, goal))
        if isinstance(exchange.reply, Refused):
            raise RowFailed(f"a move was refused: {exchange.reply.name}")
        return exchange.seq

    async def travel(self, wire: Wire, goal: MoveGoal) -> None:
        """Move and wait for the arrival. Raises RowFailed."""
        await self.arrive(wire, await self.begin(wire, goal))

    async def arrive(self, wire: Wire, seq: int) -> None:
        """Wait for the end of move `seq`. Raises RowFailed when it does not end at its goal."""
        monitor = MoveMonitor(wire.device, seq)
        try:
            while not monitor.has_arrived(await self.report(wire), self.timing.clock()):
                await self.timing.sleep(POLL_S)
        except MoveFailed as failed:
            raise RowFailed(failed.what) from failed

    async def end_of(self, wire: Wire, seq: int, limit_s: float) -> str:
        """Status name with which move `seq` ended; "" when it has not ended within the limit."""
        ends_s = self.timing.clock() + limit_s
        while self.timing.clock() < ends_s:
            report = await self.report(wire)
            if report.finished_seq == seq:
                known = [*map(int, Status)]
                return Status(report.finished_status).name if report.finished_status in known else "unknown"
            await self.timing.sleep(POLL_S)
        return ""

    async def under_way(self, wire: Wire, goal: MoveGoal) -> tuple[int, PoseReading]:
        """Begin a move and wait until the arm has left; its number, and a pose on the way."""
        start = await self.pose(wire)
        seq = await self.begin(wire, goal)
        for _ in range(250):
            now = await self.pose(wire)
            if not self.same(now, start):
                return seq, now
            await self.timing.sleep(POLL_S)
        raise RowFailed("an accepted move did not begin within 5 s")

    async def standing(self, wire: Wire, limit_s: float) -> tuple[PoseReading, float]:
        """Wait until two poses agree; the pose, and how long it took. Raises RowFailed."""
        began_s = self.timing.clock()
        before = await self.pose(wire)
        while self.timing.clock() - began_s < limit_s:
            seen_s = self.timing.clock() - began_s
            await self.timing.sleep(2 * POLL_S)
            now = await self.pose(wire)
            if self.same(before, now):
                return now, seen_s
            before = now
        raise RowFailed(f"the arm still moves after {limit_s:g} s")

    async def stays(self, wire: Wire, seconds: float) -> None:
        """See that the arm stands still. Raises RowFailed."""
        first, ends_s = await self.pose(wire), self.timing.clock() + seconds
        while self.timing.clock() < ends_s:
            await self.timing.sleep(min(BEAT_S, max(0.0, ends_s - self.timing.clock())))
            now = await self.pose(wire)
            if not self.same(first, now):
                raise RowFailed(
                    f"the arm moved by itself: {difference(first.base_T_flange, now.base_T_flange)[0]:.1f} mm"
                )

    async def reconnect(self, limit_s: float) -> Wire:
        """A greeted connection, as soon as the controller answers. Raises the last error after the limit."""
        ends_s = self.timing.clock() + limit_s
        while True:
            try:
                self._wire = wire = await Wire.open(self.transport, self.timing)
                return wire
            except DeviceError:
                if self.timing.clock() >= ends_s:
                    raise
                await self.timing.sleep(BEAT_S)

    def same(self, one: PoseReading, other: PoseReading) -> bool:
        """Whether two poses agree as those of a standing arm do."""
        off_mm, off_rad = difference(one.base_T_flange, other.base_T_flange)
        return off_mm <= STILL_MM and off_rad <= STILL_RAD


def goal_of(pose: PoseReading, speed_mm_s: float) -> MoveGoal:
    """A goal at a pose that was read."""
    return MoveGoal(pose.base_T_flange, pose.posture, pose.external_axes, speed_mm_s)
