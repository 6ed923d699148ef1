"""The arm is stopped and disarmed until its controller confirms both, whatever it answers on the way."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest

from daemon.cell.safe_stop import SafeStop
from daemon.runtime.clock import Clock
from drivers.errors import LinkLost
from drivers.interfaces import Standstill
from tests.daemon.fakes import FakeRobot
from tests.support.waiting import eventually

LOST = LinkLost("robot fake", "the connection broke", "look at the cable")
CONFIRMED, ARMED, MOVING = Standstill(True, True), Standstill(True, False), Standstill(False, True)
UNKNOWN = Standstill(False, False)


class Controller(FakeRobot):
    """A robot that reports `answers` one after the other, then the last one again; an exception is raised."""

    def __init__(self, *answers: Standstill | Exception, armed: bool = True) -> None:
        super().__init__(armed=armed)
        self.answers = list(answers)

    async def read_standstill(self) -> Standstill:
        answer = self.answers.pop(0) if len(self.answers) > 1 else self.answers[0]
        if isinstance(answer, Exception):
            raise answer
        return answer


@asynccontextmanager
async def stopping(robot: FakeRobot, leased: bool = False) -> AsyncIterator[tuple[SafeStop, list[dict[str, Any]]]]:
    """A SafeStop whose pauses take no time, and the events it publishes."""
    events: list[dict[str, Any]] = []
    clock = Clock(sleep=lambda seconds: asyncio.sleep(0))
    safe_stop = SafeStop(robot, clock, lambda: leased, lambda kind, data: events.append({"kind": kind, **data}))
    try:
        yield safe_stop, events
    finally:
        await safe_stop.stop()


def facts(events: list[dict[str, Any]]) -> list[tuple[bool, bool]]:
    assert all(event["kind"] == "arm" for event in events)
    return [(event["stopped"], event["disarmed"]) for event in events]


async def test_a_stop_that_is_confirmed_is_no_event() -> None:
    robot = Controller(CONFIRMED)
    async with stopping(robot) as (safe_stop, events):
        assert await safe_stop.stop_and_disarm() is None
        assert (robot.stops, robot.armed, events, safe_stop.warnings()) == (1, False, [], [])


async def test_an_arm_that_comes_to_rest_is_commanded_once_and_waited_for() -> None:
    robot = Controller(MOVING, MOVING, MOVING, CONFIRMED)
    async with stopping(robot) as (safe_stop, events):
        assert await safe_stop.stop_and_disarm() is None
        assert (robot.stops, events) == (1, [])


@pytest.mark.parametrize(
    ("answers", "published"),
    [
        ((ARMED, CONFIRMED), [(True, False), (True, True)]),
        ((LOST, LOST, ARMED, CONFIRMED), [(False, False), (True, False), (True, True)]),
        ((RuntimeError("a defect"), CONFIRMED), [(False, False), (True, True)]),
    ],
)
async def test_what_is_not_confirmed_is_tried_again_and_published(
    answers: Any, published: list[tuple[bool, bool]]
) -> None:
    robot = Controller(*answers)
    async with stopping(robot) as (safe_stop, events):
        assert await safe_stop.stop_and_disarm() is None
        assert facts(events) == published
        assert robot.stops == len(answers)
        assert safe_stop.warnings() == []


async def test_nobody_waits_for_ever_and_the_attempts_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("daemon.cell.safe_stop.MAX_ATTEMPT_S", 0.05)
    robot = Controller(ARMED)
    async with stopping(robot) as (safe_stop, events):
        report = await safe_stop.stop_and_disarm()
        assert report is not None
        assert report.confirmed == ARMED
        (warning,) = safe_stop.warnings()
        assert warning == "it is not confirmed that motion is switched off: the controller reports it armed"
        assert [value for metric in safe_stop.families() for value in metric.samples.values()] == [1.0]
        before = robot.stops
        await eventually(lambda: robot.stops > before)
        robot.answers = [CONFIRMED]
        await eventually(lambda: safe_stop.unconfirmed is None)
        assert facts(events) == [(True, False), (True, True)]
        assert safe_stop.warnings() == []


async def test_a_controller_that_never_answers_confirms_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("daemon.cell.safe_stop.MAX_ATTEMPT_S", 0.05)
    robot = FakeRobot(armed=True)
    robot.read_standstill = lambda: asyncio.sleep(3600)  # type: ignore[method-assign,assignment]
    async with stopping(robot) as (safe_stop, _):
        report = await safe_stop.stop_and_disarm()
        assert report is not None
        assert report.confirmed == UNKNOWN


async def test_an_arm_that_stands_is_not_stopped_again_while_its_link_is_down() -> None:
    robot = Controller(ARMED)
    async with stopping(robot) as (safe_stop, _):
        safe_stop.begin()
        await eventually(lambda: safe_stop.unconfirmed is not None and safe_stop.unconfirmed.confirmed.standing)
        robot.lost = True
        await eventually(lambda: robot.stops >= 1)
        for _ in range(50):
            await asyncio.sleep(0)
        before = robot.stops
        for _ in range(200):
            await asyncio.sleep(0)
        assert robot.stops == before
        robot.lost, robot.answers = False, [CONFIRMED]
        await eventually(lambda: safe_stop.unconfirmed is None)


async def test_an_arm_armed_without_a_lease_is_disarmed_and_published() -> None:
    robot = FakeRobot(armed=True)
    async with stopping(robot) as (safe_stop, events):
        await safe_stop.start()
        await eventually(lambda: not robot.armed and safe_stop.unconfirmed is None)
        assert facts(events) == [(True, False), (True, True)]
        assert events[0]["why"] == "it was armed without a run"


async def test_an_arm_armed_under_a_lease_is_left_alone() -> None:
    robot = FakeRobot(armed=True)
    async with stopping(robot, leased=True) as (safe_stop, events):
        await safe_stop.start()
        for _ in range(100):
            await asyncio.sleep(0)
        assert (robot.armed, robot.stops, events) == (True, 0, [])
