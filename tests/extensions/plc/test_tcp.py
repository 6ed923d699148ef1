"""The TCP front end by itself: pipelined requests, bad ones, too many, silent ones, and those who never read."""

import asyncio
import logging
import struct
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager
from typing import Any

import pytest
import uvloop
from pymodbus.client import AsyncModbusTcpClient

from extensions.plc.tcp import ModbusTcp, ModbusTcpLimits
from protocols.modbus.mbap import Adu, MbapReader
from protocols.plc.registers import BY_NAME
from tests.extensions.plc.modbus_fuzz import Tally, fuzz, served
from tests.support.waiting import LIMIT_S, eventually

QUICK = ModbusTcpLimits(connections=3, idle_s=600.0, half_frame_s=0.3)
READ = struct.pack(">BHH", 4, 16, 20)


class Wire:
    """A client that sees bytes."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.reader, self.writer = reader, writer
        self.frames = MbapReader()

    async def answers(self, count: int) -> list[Adu]:
        found: list[Adu] = []
        async with asyncio.timeout(LIMIT_S):
            while len(found) < count:
                data = await self.reader.read(65536)
                assert data, f"closed after {len(found)} of {count} answers"
                found += self.frames.feed(data)
        return found

    async def is_closed(self) -> bool:
        """Wait for the end of the connection; False when it does not come."""
        try:
            async with asyncio.timeout(LIMIT_S):
                return await self.reader.read(1) == b""
        except ConnectionError:
            return True
        except TimeoutError:
            return False


@asynccontextmanager
async def wire(port: int) -> AsyncIterator[Wire]:
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    try:
        yield Wire(reader, writer)
    finally:
        writer.close()


@pytest.mark.parametrize("depth", [1, 2, 3, 4, 8, 15, 16, 200])
async def test_pipelined_requests_are_all_answered_in_order(depth: int) -> None:
    async with served(QUICK) as server, wire(server.port) as client:
        for burst in range(3):
            sent = [Adu(burst * 1000 + number, number % 256, READ) for number in range(depth)]
            client.writer.write(b"".join(adu.encode() for adu in sent))
            answers = await client.answers(depth)
            assert [(a.transaction, a.unit) for a in answers] == [(s.transaction, s.unit) for s in sent]
            assert all(len(answer.pdu) == 42 for answer in answers)


async def test_pymodbus_loses_nothing_with_sixteen_requests_at_once() -> None:
    async with served(QUICK) as server:
        client = AsyncModbusTcpClient("127.0.0.1", port=server.port, timeout=LIMIT_S, retries=0, reconnect_delay=0)
        assert await client.connect()
        at = BY_NAME["constant_float"].address
        answers = await asyncio.gather(*(client.read_input_registers(at, count=2) for _ in range(16)))
        client.close()
        assert [answer.registers for answer in answers] == [[0x42F6, 0xE979]] * 16


@pytest.mark.parametrize(
    "bad",
    [b"\0\1\0\1\0\6\1\3\0\0\0\1", b"\0\1\0\0\0\0\1", b"\0\1\0\0\xff\xff\1\3", b"GET / HTTP/1.1\r\n\r\n", b"\0\1\0\0\0"],
    ids=["protocol", "length 0", "length 65535", "http", "half"],
)
async def test_a_bad_connection_is_closed_within_a_second_and_reported_once(
    bad: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    async with served(QUICK) as server, wire(server.port) as client:
        with caplog.at_level(logging.INFO):
            client.writer.write(Adu(7, 1, READ).encode() + bad)
            assert (await client.answers(1))[0].transaction == 7
            assert await client.is_closed()
        assert [record.levelname for record in caplog.records] == ["WARNING"]
        assert "127.0.0.1 is closed" in caplog.text
        async with wire(server.port) as other:
            other.writer.write(Adu(8, 1, READ).encode())
            assert (await other.answers(1))[0].transaction == 8


async def test_answers_before_the_bad_bytes_reach_a_client_that_reads_late(caplog: pytest.LogCaptureFixture) -> None:
    """Closing at once, over bytes that nobody has read, would reset the connection and take them back."""
    async with served(QUICK) as server, wire(server.port) as client:
        burst = [Adu(number, 1, READ).encode() for number in range(200)]
        client.writer.write(b"".join(burst) + b"GET / HTTP/1.1\r\n" + bytes(3_000_000))
        await eventually(lambda: "is closed" in caplog.text)
        assert [answer.transaction for answer in await client.answers(200)] == list(range(200))
        assert await client.is_closed()


async def test_too_many_connections_are_refused_and_a_place_that_is_left_is_given_again(
    caplog: pytest.LogCaptureFixture,
) -> None:
    async with served(QUICK) as server:
        async with wire(server.port) as a, wire(server.port) as b, wire(server.port) as c:
            for client in (a, b, c):
                client.writer.write(Adu(1, 1, READ).encode())
                await client.answers(1)
            for _ in range(3):
                async with wire(server.port) as late:
                    assert await late.is_closed()
        assert caplog.text.count("is refused: 3 are open already") == 1
        await eventually(lambda: server.connections == 0)
        async with wire(server.port) as again:
            again.writer.write(Adu(2, 1, READ).encode())
            await again.answers(1)


async def test_a_scanner_of_the_network_does_not_keep_the_plc_out() -> None:
    """Of clients that may write, by another address of this machine."""
    limits = ModbusTcpLimits(2, 30.0, has_priority=lambda client: client == "127.0.0.2")
    async with served(limits) as server, wire(server.port) as first, wire(server.port) as second:
        for client in (second, first):
            client.writer.write(Adu(1, 1, READ).encode())
            await client.answers(1)
        reader, writer = await asyncio.open_connection("127.0.0.1", server.port, local_addr=("127.0.0.2", 0))
        plc = Wire(reader, writer)
        writer.write(Adu(2, 1, READ).encode())
        assert (await plc.answers(1))[0].transaction == 2
        assert await second.is_closed()
        first.writer.write(Adu(3, 1, READ).encode())
        assert (await first.answers(1))[0].transaction == 3
        writer.close()


async def test_a_silent_connection_is_closed_and_one_that_asks_is_not() -> None:
    async with served(ModbusTcpLimits(3, idle_s=0.6)) as server, wire(server.port) as silent, wire(server.port) as busy:
        closed = asyncio.create_task(silent.is_closed())
        while not closed.done():
            busy.writer.write(Adu(1, 1, READ).encode())
            await busy.answers(1)
            await asyncio.sleep(0.02)
        assert closed.result()
        busy.writer.write(Adu(1, 1, READ).encode())
        await busy.answers(1)


def answers_waiting_bytes(server: ModbusTcp) -> int:
    """The most that is kept for a client."""
    transports = [connection._transport for connection in server._connections]
    return max(transport.get_write_buffer_size() for transport in transports if transport is not None)


async def test_a_client_that_never_reads_is_not_kept_and_holds_up_nobody() -> None:
    async with served(ModbusTcpLimits(3, idle_s=0.5)) as server, wire(server.port) as deaf, wire(server.port) as other:
        deaf.writer.transport.set_write_buffer_limits(high=1 << 26)
        whole = struct.pack(">BHH", 4, 0, 125)
        deaf.writer.write(Adu(1, 1, whole).encode() * 200_000)
        other.writer.write(Adu(2, 1, READ).encode())
        assert (await other.answers(1))[0].transaction == 2
        async with asyncio.timeout(LIMIT_S):
            while server.connections > 1:
                other.writer.write(Adu(2, 1, READ).encode())
                await other.answers(1)
                assert answers_waiting_bytes(server) < 100_000
                await asyncio.sleep(0.02)
        deaf.writer.transport.abort()


async def test_stopping_closes_every_connection() -> None:
    async with served(QUICK) as server, wire(server.port) as client:
        client.writer.write(Adu(1, 1, READ).encode())
        await client.answers(1)
        await server.stop()
        assert await client.is_closed()


@pytest.mark.parametrize("run", [asyncio.run, uvloop.run], ids=["asyncio", "uvloop"])
def test_two_thousand_fuzzed_frames_lose_nothing_and_break_nothing(
    run: Callable[[Coroutine[Any, Any, Tally]], Tally],
) -> None:
    """In the daemon's event loop, too. A million of them: `python -m benchmarks.daemon.modbus --frames 1000000`."""
    tally = run(fuzz(2_000, seed=20261121))
    assert tally.clean, tally.table() + "\n".join(tally.errors)
    assert (tally.frames, tally.answered) == (2_000, 2_000)
