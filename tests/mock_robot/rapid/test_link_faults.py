"""The shipped RAPID at a bad line: flipped bits, lost and doubled frames, garbage, a restart."""

import asyncio
import random
from contextlib import suppress

import pytest

from mock_robot.faults.tables import FAULTS
from protocols.cb import messages as cb
from protocols.cb.client import RepeatWanted, ReplyReceived
from protocols.cb.codes import Status
from protocols.cb.frames import Frame
from tests.mock_robot.cb_client import over_tcp
from tests.mock_robot.controller_client import AWAY, HOME, move_to
from tests.mock_robot.rapid.rapid_client import (
    ends_as,
    talking,
)
from tests.support.waiting import LIMIT_S, eventually

pytestmark = pytest.mark.slow

WIRES = pytest.mark.parametrize("serial", [False, True], ids=["tcp", "serial"])

GOOD = move_to(AWAY)

LINE_FAULTS = sorted(name for name, fault in FAULTS.items() if fault.area in ("link", "serial"))


@WIRES
async def test_a_request_with_a_flipped_bit_is_not_done(serial: bool) -> None:
    async with talking(serial=serial) as (cell, client):
        request = bytearray(client.session.request(GOOD))
        request[40] ^= 4
        client.write(bytes(request))
        heard = await client.hears()
        assert any(isinstance(event, RepeatWanted) for event in heard)
        if serial:
            async with asyncio.timeout(LIMIT_S):
                client.write(client.session.repeat())
                while not any(isinstance(event, ReplyReceived) for event in await client.hears()):
                    pass
            assert await ends_as(client, client.session.last_seq) is Status.OK
            assert cell.commanded_moves == 1
        else:
            with pytest.raises(ConnectionError):
                while True:
                    await client.hears()
            await eventually(lambda: not cell.controller.armed)
            assert cell.commanded_moves == 0


@WIRES
async def test_no_random_schedule_of_faults_moves_twice_for_one_request(serial: bool) -> None:
    """The full thousand run at the Python twin; here the same client meets the interpreter."""
    departures = 0
    for seed in range(4):
        schedule = random.Random(seed)
        async with talking(serial=serial, time_scale=200.0) as (cell, client):
            requests = 0
            for _ in range(3):
                cell.inject_fault(schedule.choice(LINE_FAULTS), after_moves=schedule.randrange(2))
                request = client.session.request(move_to(schedule.choice([HOME, AWAY])))
                client.session.abandon()
                requests += 1
                for _ in range(schedule.randrange(1, 4)):
                    client.write(request)
                    with suppress(TimeoutError, ConnectionError):
                        async with asyncio.timeout(0.1):
                            await client.read()
                cell.clear_faults()
            await eventually(lambda: not cell.moving)
            assert cell.controller.arm.departures <= requests
            departures += cell.controller.arm.departures
    assert departures >= 3, "the schedules must let the arm move, or they show nothing"


async def test_half_a_frame_closes_tcp_after_half_a_second() -> None:
    async with talking() as (_, client):
        client.write(client.session.request(cb.Ping())[:7])
        with pytest.raises(ConnectionError):
            await client.hears()


async def test_a_serial_line_is_resynchronised_behind_garbage_and_half_frames() -> None:
    async with talking(serial=True) as (_, client):
        ping = client.session.request(cb.Ping())
        for dirt in (b"\x00\xff\x11\x13", b"\x43\x42", b"\x43", ping[:5], b"\x43\x42\x01\x01\x01\x00\x00\x00\xf4\x03"):
            client.write(dirt)
            client.write(ping)
            async with asyncio.timeout(LIMIT_S):
                while not (data := await client.read()).endswith(Frame(0x81, client.session.last_seq).encode()):
                    assert isinstance(data, bytes)


async def test_every_request_may_come_byte_by_byte() -> None:
    async with talking() as (cell, client):
        for byte in client.session.request(GOOD):
            client.write(bytes([byte]))
            await asyncio.sleep(0)
        assert await client.is_answered() == cb.MoveAccepted()
        await eventually(lambda: cell.commanded_moves == 1)


async def test_a_restart_counts_the_session_up_and_closes_the_connection() -> None:
    async with talking() as (cell, client):
        before = cell.controller.session
        cell.inject_fault("link-restart")
        with pytest.raises(ConnectionError):
            await client.hears()
        assert cell.controller.session == before + 1
        async with over_tcp(int(cell.announcement.robot_port or 0)) as again:
            await again.is_armed()
            assert await again.moves(GOOD) is Status.OK
