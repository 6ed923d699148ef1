"""What a connection may cost before it has shown a key; those with a key are answered beside any number of others."""

import asyncio
import gc
import json
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from uvicorn.protocols.http.httptools_impl import RequestResponseCycle

from daemon.access.roles import Role
from daemon.http.connection_limiter import ConnectionLimiter, HttpLimits, Places, network_of
from tests.daemon.access_keys import TEST
from tests.daemon.cell_under_test import Bench, serving, settings_for
from tests.daemon.http.tls_files import certificate, trusting
from tests.support.waiting import LIMIT_S, eventually

Ends = tuple[asyncio.StreamReader, asyncio.StreamWriter]
FEW = HttpLimits(head_s=600, body_s=600, connections=40)
SLOW_SETUP = b"POST /setup HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1000\r\n\r\n{"
HEALTH = b"GET /health HTTP/1.1\r\nHost: localhost\r\n\r\n"


@dataclass
class Attacked:
    """A daemon with a key, and how to connect to it."""

    bench: Bench
    key: str
    tls: Any

    @asynccontextmanager
    async def connected(self, source: str = "127.0.0.1") -> AsyncIterator[Ends]:
        url = urlsplit(self.bench.url)
        name = "localhost" if self.tls else None
        reader, writer = await asyncio.open_connection(
            url.hostname, url.port, local_addr=(source, 0), ssl=self.tls, server_hostname=name
        )
        try:
            yield reader, writer
        finally:
            writer.transport.abort()

    def request(self, line: str) -> bytes:
        return f"{line} HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {self.key}\r\n\r\n".encode()

    async def status(self, ends: Ends, request: bytes) -> int:
        ends[1].write(request)
        return await status_of(ends[0])


async def status_of(reader: asyncio.StreamReader) -> int:
    """The status of the next answer, whose body is read too."""
    head = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), LIMIT_S)
    length = next(int(line[15:]) for line in head.lower().split(b"\r\n") if line.startswith(b"content-length:"))
    await asyncio.wait_for(reader.readexactly(length), LIMIT_S)
    return int(head.split()[1])


async def refusal(reader: asyncio.StreamReader) -> str:
    """The code of the problem after which the connection ends; "" when it ends without one."""
    answer = b""
    with suppress(ConnectionError):
        async with asyncio.timeout(LIMIT_S):
            while piece := await reader.read(65536):
                answer += piece
    _, _, body = answer.rpartition(b"\r\n\r\n")
    return str(json.loads(body)["code"]) if body else ""


@asynccontextmanager
async def attacked(folder: Path, limits: HttpLimits = FEW, secured: bool = False) -> AsyncIterator[Attacked]:
    server = certificate(folder / "tls") if secured else {}
    door = ConnectionLimiter(limits)
    async with serving(settings_for(folder / "store", server=server), door=door) as bench:
        key, _ = await bench.application.key_service.add("operator", Role.OPERATOR, TEST)
        yield Attacked(bench, key, trusting(folder / "tls") if secured else None)


secured_or_not = pytest.mark.parametrize("secured", [False, True], ids=["plain", "tls"])


@secured_or_not
@pytest.mark.parametrize("addresses", [1, 100], ids=["one address", "many addresses"])
async def test_any_number_of_slow_bodies_keeps_nobody_with_a_key_out(
    tmp_path: Path, secured: bool, addresses: int
) -> None:
    """Three times as many as there may be connections; each request with a key, and abort, comes through."""
    async with attacked(tmp_path, FEW, secured) as cell, AsyncExitStack() as open_ones:
        reader, writer = await open_ones.enter_async_context(cell.connected())
        writer.write(cell.request("GET /events"))
        await asyncio.wait_for(reader.readuntil(b"what happens in the cell\n\n"), LIMIT_S)
        for k in range(3 * FEW.connections):
            _, slow = await open_ones.enter_async_context(cell.connected(f"127.0.0.{1 + k % addresses}"))
            slow.write(SLOW_SETUP)
            if k % 10 == 0:
                async with cell.connected() as ends:
                    assert await cell.status(ends, cell.request("POST /runs/20261121-090000-3f9a1c/abort")) == 404
        cell.bench.application.events.publish("test", {})
        assert await asyncio.wait_for(reader.readuntil(b"data: {}"), LIMIT_S)  # it was not closed for a newcomer
        assert len(cell.bench.server.server_state.connections) <= FEW.connections


async def test_more_connections_with_a_key_than_there_may_be_keep_nobody_out(tmp_path: Path) -> None:
    async with attacked(tmp_path) as cell, AsyncExitStack() as open_ones:
        for _ in range(2 * FEW.connections):
            reader, writer = await open_ones.enter_async_context(cell.connected())
            writer.write(cell.request("GET /events"))
            await asyncio.wait_for(reader.readuntil(b"\n\n"), LIMIT_S)
        async with cell.connected() as ends:
            assert await cell.status(ends, cell.request("POST /runs/20261121-090000-3f9a1c/abort")) == 404
        assert len(cell.bench.server.server_state.connections) <= FEW.connections


async def test_a_body_without_a_key_must_come_in_time_even_if_it_trickles(tmp_path: Path) -> None:
    door = ConnectionLimiter(HttpLimits(body_s=0.3))
    async with (
        serving(settings_for(tmp_path), door=door) as bench,
        Attacked(bench, "", None).connected() as (reader, writer),
    ):
        await trickle(writer, SLOW_SETUP, refused := asyncio.create_task(refusal(reader)))
        assert refused.result() == "request-too-slow"


async def test_a_body_with_a_key_has_a_least_rate(tmp_path: Path) -> None:
    limits = HttpLimits(idle_s=0.4, body_bytes_per_s=1e6)
    async with attacked(tmp_path, limits) as cell, cell.connected() as (reader, writer):
        head = cell.request("POST /calibrate").replace(b"\r\n\r\n", b"\r\nContent-Length: 1000000\r\n\r\n")
        await trickle(writer, head, refused := asyncio.create_task(refusal(reader)))
        assert refused.result() == "request-too-slow"


async def trickle(writer: asyncio.StreamWriter, begun: bytes, refused: "asyncio.Task[str]") -> None:
    writer.write(begun)
    while not refused.done():
        writer.write(b" ")
        await asyncio.sleep(0.02)


@pytest.mark.slow
@secured_or_not
async def test_requests_ahead_are_not_parsed_before_their_turn(tmp_path: Path, secured: bool) -> None:
    """All are answered in their order, and one at a time exists."""
    count = 1000
    async with attacked(tmp_path, secured=secured) as cell, cell.connected() as (reader, writer):
        writer.write(HEALTH * count)
        for k in range(count):
            assert await status_of(reader) == 200
            if k % 100 == 0:
                cycles = [each for each in gc.get_objects() if isinstance(each, RequestResponseCycle)]
                assert sum(not each.response_complete and each.scope["path"] == "/health" for each in cycles) <= 1
        assert cell.bench.application.metrics.requests["GET", 200] == count


CUT_ANYWHERE = [
    HEALTH,
    b"POST /nowhere HTTP/1.1\r\nHost: localhost\r\nContent-Length: 7\r\n\r\n\r\n\r\n{}\n",
    b"POST /nowhere HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n"
    b"4\r\n\r\n\r\n\r\n2;x\r\n{}\r\n0\r\n\r\n",
    b"\r\n\r\n" + HEALTH,
]


@pytest.mark.parametrize("piece", [1, 2, 3, 7, 1000])
async def test_requests_cut_anywhere_are_answered_in_order(tmp_path: Path, piece: int) -> None:
    async with serving(settings_for(tmp_path)) as bench, Attacked(bench, "", None).connected() as (reader, writer):
        sent = b"".join(CUT_ANYWHERE) * 3
        for k in range(0, len(sent), piece):
            writer.write(sent[k : k + piece])
            await writer.drain()
            await asyncio.sleep(0)
        assert [await status_of(reader) for _ in range(12)] == [200, 404, 404, 200] * 3


TRAILERS = {
    "a header": (b"0\r\nOrigin: http://127.0.0.1\r\n\r\n", "request-malformed"),
    "a name without end": (b"0\r\n" + b"x" * 200_000, "head-too-large"),
    "a value without end": (b"0\r\nX: " + b"x" * 200_000, "head-too-large"),
    "an extension without end": (b"0;" + b"x" * 200_000, "head-too-large"),
}


@secured_or_not
@pytest.mark.parametrize("case", TRAILERS)
async def test_trailers_are_refused(tmp_path: Path, case: str, secured: bool) -> None:
    sent, code = TRAILERS[case]
    async with attacked(tmp_path, secured=secured) as cell, cell.connected() as (reader, writer):
        head = cell.request("POST /scans").replace(b"\r\n\r\n", b"\r\nTransfer-Encoding: chunked\r\n\r\n2\r\n{}\r\n")
        writer.write(head + sent)
        assert await refusal(reader) == code
        assert not (await cell.bench.application.store.listings.scans(10))


async def test_a_key_in_a_trailer_is_none(tmp_path: Path) -> None:
    async with attacked(tmp_path) as cell, cell.connected() as (reader, writer):
        head = b"POST /scans HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n2\r\n{}\r\n"
        writer.write(head + f"0\r\nAuthorization: Bearer {cell.key}\r\n\r\n".encode())
        assert await refusal(reader) == "request-malformed"


async def test_the_number_of_headers_is_limited(tmp_path: Path) -> None:
    async with attacked(tmp_path) as cell, cell.connected() as (reader, writer):
        writer.write(b"GET /health HTTP/1.1\r\nHost: localhost\r\n" + b"a:\r\n" * 1000)
        assert await refusal(reader) == "head-too-large"


@pytest.mark.parametrize("extra", [b"", HEALTH, b" " * 500_000], ids=["nothing", "a request", "half a MB"])
async def test_a_client_that_hangs_up_is_noticed_whatever_it_sent_ahead(tmp_path: Path, extra: bytes) -> None:
    """Reading is paused by what it sent ahead, so that the end of the connection is not seen in the stream."""
    async with attacked(tmp_path, HttpLimits(idle_s=0.4)) as cell:
        async with cell.connected() as (reader, writer):
            writer.write(cell.request("GET /events") + extra)
            await asyncio.wait_for(reader.readuntil(b"what happens in the cell\n\n"), LIMIT_S)
        await eventually(lambda: not cell.bench.server.server_state.connections)
        await eventually(lambda: not cell.bench.server.server_state.tasks)


async def test_a_body_that_comes_after_its_answer_does_not_keep_the_connection(tmp_path: Path) -> None:
    limits = HttpLimits(head_s=0.3, body_s=0.3)
    async with attacked(tmp_path, limits) as cell, cell.connected() as (reader, writer):
        writer.write(HEALTH.replace(b"\r\n\r\n", b"\r\nContent-Length: 5\r\n\r\n"))
        assert await status_of(reader) == 200
        writer.write(b"12345")
        assert await refusal(reader) == "request-too-slow"


async def test_another_protocol_is_not_spoken_and_what_follows_is_no_request(tmp_path: Path) -> None:
    async with attacked(tmp_path) as cell, cell.connected() as (reader, writer):
        asks = HEALTH.replace(b"\r\n\r\n", b"\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\r\n")
        writer.write(asks + HEALTH + b"\x81\x85\x00\x00" * 100)
        assert await status_of(reader) == 200
        assert await refusal(reader) == ""


class FakeConnection:
    def __init__(self, address: str) -> None:
        self.address, self.displaced = address, False

    def displace(self) -> None:
        self.displaced = True


def test_the_address_with_most_connections_makes_room() -> None:
    places = Places(10)
    crowd = [FakeConnection("10.0.0.1") for _ in range(7)]
    alone = [FakeConnection(f"10.0.0.{k}") for k in range(2, 10)]
    for connection in (*crowd, *alone):
        places.take(connection)
    assert len(places) == 10
    assert [each.displaced for each in crowd] == 5 * [True] + 2 * [False]  # 2 by its own share, 3 for others
    assert not any(each.displaced for each in alone)
    for connection in (*crowd, *alone):
        places.leave(connection)
    assert len(places) == 0


def test_a_connection_that_ends_before_its_key_is_found_valid_takes_no_place() -> None:
    limiter, gone = ConnectionLimiter(FEW), FakeConnection("10.0.0.1")
    limiter.admit(gone)
    limiter.release(gone)
    limiter.authenticate(gone)
    assert (len(limiter.unauthenticated), len(limiter.authenticated)) == (0, 0)


def test_a_machine_does_not_gain_by_its_many_ipv6_addresses() -> None:
    assert network_of("2001:db8::1") == network_of("2001:db8::ffff:1") != network_of("2001:db8:0:1::1")
    assert network_of("::ffff:10.0.0.1") == network_of("10.0.0.1") != network_of("10.0.0.2")
    assert network_of("an unknown peer") == "an unknown peer"
