"""The drift schedule moves the arm only while somebody has the cell in use: after nothing else by itself."""

import asyncio
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from daemon.drift.schedule import POLL_S, RETRY_S, DriftSchedule
from daemon.errors import CellBusy, CellNotReady, DaemonError, InterlockOpen, NoCalibration
from daemon.model.records import RunRecord
from daemon.model.run_states import RunState
from daemon.runtime.clock import Clock
from drivers.interfaces import LinkHealth
from tests.daemon.cell_under_test import Parts, serving, settings_for
from tests.support.waiting import FakeTime

HOUR_S = 3600.0


def a_run(name: str, state: RunState = RunState.FINISHED, **request: object) -> RunRecord:
    at = "2026-11-21T10:00:00.000Z"
    return RunRecord(name, "verify", state, 3, 3, at, at, request=request)


@dataclass
class FakeOperations:
    """Operations, supervisor and cell in one: the latest run, what is in the arm's way, and what was started."""

    latest: RunRecord | None = None
    obstacles: tuple[str, ...] = ()
    obstacles_seen: int = 0
    last_obstacle: str = ""
    abort_holds: int = 0
    link: LinkHealth = field(default_factory=lambda: LinkHealth(True, "connected", 0.0))
    refusals: list[DaemonError] = field(default_factory=list)
    asked: int = 0
    started: int = 0

    @property
    def supervisor(self) -> "FakeOperations":
        return self

    @property
    def cell(self) -> "FakeOperations":
        return self

    @property
    def occupancy(self) -> "FakeOperations":
        return self

    @property
    def robot(self) -> "FakeOperations":
        return self

    @property
    def in_progress(self) -> RunRecord | None:
        return None if self.latest is None or self.latest.is_over else self.latest

    async def robot_obstacles(self) -> tuple[str, ...]:
        return self.obstacles

    async def verify(self, _request: object) -> RunRecord:
        self.asked += 1
        if self.refusals:
            raise self.refusals.pop(0)
        self.started += 1
        self.latest = a_run(f"scheduled {self.started}")
        return self.latest


@dataclass
class Scheduled:
    """A schedule of one hour at a fake cell."""

    operations: FakeOperations
    time: FakeTime
    schedule: DriftSchedule

    async def pass_s(self, duration_s: float) -> None:
        """Second by second, as the schedule looks."""
        for _ in range(round(duration_s / POLL_S)):
            await self.time.advance(POLL_S)


@pytest.fixture
async def scheduled() -> Scheduled:
    operations, time = FakeOperations(a_run("by somebody")), FakeTime()
    schedule = DriftSchedule(operations, Clock(lambda: time.now_s, sleep=time.sleep), 60.0)  # type: ignore[arg-type]
    return Scheduled(operations, time, schedule)


async def test_it_waits_a_whole_interval_first_and_then_verifies_again_and_again(scheduled: Scheduled) -> None:
    await scheduled.schedule.start()
    await scheduled.pass_s(59)
    assert scheduled.operations.asked == 0
    await scheduled.pass_s(1)
    assert scheduled.operations.started == 1
    assert scheduled.schedule.warnings() == []
    await scheduled.pass_s(60)
    assert scheduled.operations.started == 2
    await scheduled.schedule.stop()


async def test_while_another_run_is_in_progress_it_is_tried_again(scheduled: Scheduled) -> None:
    scheduled.operations.refusals = [CellBusy("somebody")]
    await scheduled.schedule.start()
    scheduled.operations.latest = a_run("by somebody", RunState.MOVING)
    await scheduled.pass_s(60)
    assert scheduled.operations.asked == 0
    scheduled.operations.latest = a_run("by somebody")
    await scheduled.pass_s(RETRY_S)
    assert (scheduled.operations.asked, scheduled.operations.started) == (1, 0)
    await scheduled.pass_s(RETRY_S)
    assert scheduled.operations.started == 1
    await scheduled.schedule.stop()


NOT_IN_USE = [
    (None, "the daemon has been started"),
    (a_run("a", RunState.FAILED), "run a failed"),
    (a_run("a", RunState.ABORTED), "run a was aborted"),
    (a_run("a", manual=True), "in run a the arm was moved by hand"),
    (replace(a_run("a"), kind="jog"), "in run a the arm was moved by hand"),
]


@pytest.mark.parametrize(("latest", "why"), NOT_IN_USE, ids=[why for _, why in NOT_IN_USE])
async def test_after_a_restart_a_stop_or_a_fault_it_waits_for_somebody(
    scheduled: Scheduled, latest: RunRecord | None, why: str
) -> None:
    scheduled.operations.latest = latest
    await scheduled.schedule.start()
    assert scheduled.schedule.warnings() == [
        f"the drift schedule makes no quick checks until somebody starts a run: {why}"
    ]
    await scheduled.pass_s(200)
    assert scheduled.operations.asked == 0
    scheduled.operations.latest = a_run("by somebody else")
    assert scheduled.schedule.warnings() == []
    await scheduled.pass_s(60)
    assert scheduled.operations.started == 1
    await scheduled.schedule.stop()


@pytest.mark.parametrize("seen", ["robot: emergency stop is pressed", "robot: not in automatic mode", "interlock gate"])
async def test_after_what_kept_the_arm_from_moving_it_waits_for_somebody(scheduled: Scheduled, seen: str) -> None:
    """However long before the verification falls due it was, and though it is over by then."""
    await scheduled.schedule.start()
    await scheduled.pass_s(10)
    scheduled.operations.obstacles = (seen,)
    await scheduled.pass_s(2)
    scheduled.operations.obstacles = ()
    await scheduled.pass_s(300)
    assert scheduled.operations.asked == 0
    assert scheduled.schedule.warnings()[0].endswith(seen)
    scheduled.operations.latest = a_run("by somebody else")
    await scheduled.pass_s(60)
    assert scheduled.operations.started == 1
    await scheduled.schedule.stop()


BETWEEN_TWO_CHECKS: list[tuple[dict[str, object], str]] = [
    ({"obstacles_seen": 1, "last_obstacle": "interlock gate: is 0"}, "interlock gate: is 0"),
    ({"abort_holds": 1}, "a PLC set abort"),
    ({"link": LinkHealth(True, "connected", 7.0)}, "the link to the robot was interrupted"),
]


@pytest.mark.parametrize(("changes", "why"), BETWEEN_TWO_CHECKS, ids=[why for _, why in BETWEEN_TWO_CHECKS])
async def test_what_was_over_before_the_next_check_counts_too(
    scheduled: Scheduled, changes: dict[str, object], why: str
) -> None:
    await scheduled.schedule.start()
    await scheduled.pass_s(10)
    for name, value in changes.items():
        setattr(scheduled.operations, name, value)
    await scheduled.pass_s(100)
    assert scheduled.operations.asked == 0
    assert scheduled.schedule.warnings()[0].endswith(why)
    scheduled.operations.latest = a_run("by somebody else")
    await scheduled.pass_s(60)
    assert scheduled.operations.started == 1
    await scheduled.schedule.stop()


async def test_what_was_over_before_the_first_check_after_a_run_counts_too(scheduled: Scheduled) -> None:
    scheduled.operations.latest = a_run("by somebody", RunState.MOVING)
    await scheduled.schedule.start()
    await scheduled.pass_s(10)
    scheduled.operations.latest = a_run("by somebody")
    scheduled.operations.obstacles_seen, scheduled.operations.last_obstacle = 1, "interlock gate: is 0"
    await scheduled.pass_s(100)
    assert scheduled.operations.asked == 0
    assert scheduled.schedule.warnings()[0].endswith("interlock gate: is 0")
    await scheduled.schedule.stop()


async def test_an_obstacle_that_anybody_sees_is_counted(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path)) as bench:
        cell = bench.application.cell
        assert await cell.robot_obstacles() == ()
        assert cell.occupancy.obstacles_seen == 0
        bench.robot.status = {"automatic": False}
        await bench.client.get("/calibrate")
        bench.robot.status = {}
        assert cell.occupancy.obstacles_seen == 1
        assert cell.occupancy.last_obstacle == "robot: not in automatic mode"


@pytest.mark.parametrize(
    "refusal", [CellNotReady(("robot: motors are off",)), InterlockOpen(("gate",), ("gate: is 0",))]
)
async def test_one_that_is_refused_is_left_out(scheduled: Scheduled, refusal: DaemonError) -> None:
    scheduled.operations.refusals = [refusal]
    await scheduled.schedule.start()
    await scheduled.pass_s(300)
    assert scheduled.operations.asked == 1
    assert scheduled.schedule.warnings()
    await scheduled.schedule.stop()


async def test_one_that_cannot_be_done_for_another_reason_is_left_out_until_the_next(scheduled: Scheduled) -> None:
    scheduled.operations.refusals = [NoCalibration()]
    await scheduled.schedule.start()
    await scheduled.pass_s(119)
    assert (scheduled.operations.asked, scheduled.operations.started) == (1, 0)
    await scheduled.pass_s(1)
    assert scheduled.operations.started == 1
    await scheduled.schedule.stop()


async def test_without_an_interval_nothing_is_scheduled() -> None:
    schedule = DriftSchedule(FakeOperations(), Clock(), 0.0)  # type: ignore[arg-type]
    await schedule.start()
    assert schedule._task is None
    assert schedule.warnings() == []
    await schedule.stop()


@dataclass
class StepClock:
    """A sleep ends when the test says so; each passes a minute."""

    now_s: float = 0.0
    step: asyncio.Event = field(default_factory=asyncio.Event)
    waits: asyncio.Event = field(default_factory=asyncio.Event)

    async def sleep(self, _seconds: float) -> None:
        self.waits.set()
        await self.step.wait()
        self.step.clear()
        self.now_s += 60.0

    async def minute(self) -> None:
        """The schedule has done what it does after a minute."""
        self.waits.clear()
        self.step.set()
        await self.waits.wait()


async def test_ready_says_when_nothing_is_scheduled(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path, drift={"every_h": 1})) as bench:
        (warning,) = (await bench.client.get("/ready")).json()["warnings"]
        assert warning.startswith("the drift schedule makes no quick checks until somebody starts a run")


async def test_a_released_emergency_stop_moves_nothing(tmp_path: Path) -> None:
    """The verification falls due while the stop is pressed; nobody asks for anything after it."""
    parts = Parts()
    async with serving(
        settings_for(tmp_path, calibration={"policy": "auto", "tolerance_mm": 20.0}, drift={"every_h": 1}), parts
    ) as bench:
        await bench.run_over((await bench.client.post("/calibrate")).headers["location"])
        await bench.verify()
        goals, clock = len(bench.robot.goals), StepClock()
        schedule = DriftSchedule(bench.application.operations, Clock(lambda: clock.now_s, sleep=clock.sleep), 60.0)
        await schedule.start()
        await clock.waits.wait()
        bench.robot.status = {"emergency_stop": True, "motors_on": False}
        await clock.minute()
        bench.robot.status = {}
        for _ in range(3):
            await clock.minute()
        assert len(bench.robot.goals) == goals
        assert "emergency stop is pressed" in schedule.warnings()[0]
        await bench.verify()
        begun = len(bench.robot.goals)
        await clock.minute()
        run = bench.application.supervisor.latest
        assert run is not None
        await bench.application.supervisor.wait(run.id, 10)
        assert len(bench.robot.goals) > begun
        await schedule.stop()
