"""A cell that runs the shipped RAPID, and a client at its link: requests, waiting for their end, moving anew."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

import numpy as np

from protocols.cb import messages as cb
from protocols.cb.codes import Status
from tests.mock_robot.cb_client import CbClient, over_serial, over_tcp
from tests.mock_robot.controller_client import AWAY, move_to
from tests.mock_robot.running_cell import RunningCell, running_cell
from tests.support.waiting import LIMIT_S


@asynccontextmanager
async def talking(
    *, serial: bool = False, time_scale: float = 20.0, armed: bool = True
) -> AsyncIterator[tuple[RunningCell, CbClient]]:
    """A cell that runs the RAPID, and a client that has said HELLO."""
    async with running_cell(time_scale=time_scale, serial=serial, devices=False, program="rapid") as cell:
        wire = cell.announcement
        link = over_serial(str(wire.serial_path)) if serial else over_tcp(int(wire.robot_port or 0))
        async with link as client:
            welcome = await client.asks(cb.Hello(1, 1, 9))
            assert isinstance(welcome, cb.Welcome)
            if armed:
                assert await client.asks(cb.SetArmed(welcome.session, True)) == cb.ArmingDone()
            yield cell, client


def joints_now(cell: RunningCell) -> np.ndarray:
    controller = cell.controller
    return controller.arm.joints_at(controller.robot_s(cell.cell.clock()))


async def report_of(client: CbClient) -> cb.Report:
    report = await client.asks(cb.GetStatus())
    assert isinstance(report, cb.Report)
    return report


async def ends_as(client: CbClient, seq: int, within_s: float = LIMIT_S) -> Status:
    async with asyncio.timeout(within_s):
        while (report := await report_of(client)).finished_seq != seq:  # noqa: ASYNC110 - it happens in the controller
            await asyncio.sleep(0.02)
    return Status(report.finished_status)


async def is_answered(client: CbClient, request: cb.Request, wanted: cb.Reply, meanwhile: Callable[[], None]) -> None:
    """Ask until the answer is that one. Raises AssertionError with the last other answer."""
    reply = None
    try:
        async with asyncio.timeout(LIMIT_S):
            while (reply := await client.asks(request)) != wanted:
                meanwhile()
                await asyncio.sleep(0.02)
    except TimeoutError:
        raise AssertionError(f"{request} was answered {reply}, not {wanted}") from None


async def moves_again(cell: RunningCell, client: CbClient) -> None:
    """Put right at the pendant with one press of start, armed anew, moved anew; until then nothing moves."""
    standing, departures = joints_now(cell), cell.controller.arm.departures

    def stands() -> None:
        np.testing.assert_array_equal(joints_now(cell), standing)
        assert cell.controller.arm.departures == departures

    cell.controller.press_emergency_stop(False, cell.cell.clock())
    cell.controller.recover(cell.cell.clock())
    await is_answered(client, cb.SetArmed(cell.controller.session, True), cb.ArmingDone(), stands)
    await is_answered(client, move_to(AWAY, 1000.0), cb.MoveAccepted(), stands)
    assert await ends_as(client, client.session.last_seq) is Status.OK


async def answer_to(client: CbClient, data: bytes) -> bytes:
    """One frame's worth of bytes, as they came."""
    client.write(data)
    answer = b""
    async with asyncio.timeout(LIMIT_S):
        while len(answer) < 12 or len(answer) < 12 + int.from_bytes(answer[8:10], "little"):
            answer += await client.read()
    return answer
