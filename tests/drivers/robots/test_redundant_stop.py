"""A stop that goes the second way when the robot's own link has failed."""

import asyncio

import numpy as np
import pytest

from calibration.kinematics.arm import Configuration
from drivers.errors import AddressNotUnderstood, DeviceUnreachable, LinkLost, MoveRefused
from drivers.interfaces import LinkHealth, MoveGoal, Standstill
from drivers.registry import check_stop_address
from drivers.robots.abb.rws.redundant_stop import RedundantStop
from tests.support.waiting import quick_timing

GOAL = MoveGoal(np.eye(4), Configuration(0, 0, 0, 0))


class Way:
    """One way to a robot; `answers` is what its stop and its move do."""

    def __init__(self, answers: BaseException | float | None = None, connected: bool = True) -> None:
        self.answers, self.stops, self.closed = answers, 0, False
        self.link = LinkHealth(connected, "somewhere", 0.0)

    async def stop_and_disarm(self) -> None:
        self.stops += 1
        await self._answer()

    async def read_standstill(self) -> Standstill:
        return Standstill(standing=True, disarmed=True)

    async def move_to(self, goal: MoveGoal) -> None:
        await self._answer()

    async def close(self) -> None:
        self.closed = True

    async def _answer(self) -> None:
        if isinstance(self.answers, BaseException):
            raise self.answers
        await asyncio.sleep(self.answers or 0.0)


def both(own: Way, second: Way) -> RedundantStop:
    return RedundantStop(own, second, quick_timing())  # type: ignore[arg-type]


async def test_a_stop_that_is_answered_leaves_the_program_alone():
    own, second = Way(), Way()
    await both(own, second).stop_and_disarm()
    assert (own.stops, second.stops) == (1, 0)


@pytest.mark.parametrize("answers", [LinkLost("r", "gone", "wait"), 30.0])
async def test_a_stop_that_fails_or_is_late_goes_the_second_way(answers):
    own, second = Way(answers), Way()
    await both(own, second).stop_and_disarm()
    assert (own.stops, second.stops) == (1, 1)


async def test_when_both_ways_fail_the_first_ones_error_is_raised():
    own, second = Way(LinkLost("r", "gone", "wait")), Way(DeviceUnreachable("s", "away", "look"))
    with pytest.raises(LinkLost):
        await both(own, second).stop_and_disarm()
    assert second.stops == 1


@pytest.mark.parametrize("connected", [True, False])
async def test_the_second_way_cannot_confirm_that_the_arm_is_disarmed(connected):
    robot = both(Way(connected=connected), Way())
    assert await robot.read_standstill() == Standstill(standing=True, disarmed=connected)


async def test_a_link_that_breaks_in_a_move_stops_the_arm_the_second_way():
    own, second = Way(LinkLost("r", "gone", "wait")), Way()
    with pytest.raises(LinkLost):
        await both(own, second).move_to(GOAL)
    assert second.stops == 1


async def test_a_move_that_the_controller_refused_stops_nothing():
    own, second = Way(MoveRefused("r", "not armed", "arm", "NOT_ARMED")), Way()
    with pytest.raises(MoveRefused):
        await both(own, second).move_to(GOAL)
    assert second.stops == 0


@pytest.mark.parametrize(("connected", "stops"), [(True, 0), (False, 1)])
async def test_a_cancelled_move_is_stopped_the_second_way_when_the_link_is_gone(connected, stops):
    own, second = Way(30.0, connected), Way()
    moving = asyncio.create_task(both(own, second).move_to(GOAL))
    await asyncio.sleep(0)
    moving.cancel()
    with pytest.raises(asyncio.CancelledError):
        await moving
    assert second.stops == stops


async def test_the_link_reports_both_ways_and_close_closes_both():
    own, second = Way(), Way(connected=False)
    robot = both(own, second)
    assert robot.link.connected
    assert "second way to stop: NOT there, somewhere" in robot.link.detail
    await robot.close()
    assert own.closed
    assert second.closed


def test_the_second_way_is_rws():
    check_stop_address("rws://192.168.125.1")
    with pytest.raises(AddressNotUnderstood, match="write rws://host"):
        check_stop_address("tcp://192.168.125.1:5020")
