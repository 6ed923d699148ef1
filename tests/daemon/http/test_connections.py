"""Connections that misbehave: told in words, cut off in time, and nobody else waits for them."""

import asyncio
import json
import resource
import socket
import struct
import sys
import threading
from collections.abc import AsyncIterator, Callable, Iterable
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any, cast
from urllib.parse import urlsplit

import pytest

from daemon.http.connection_limiter import ConnectionLimiter, HttpLimits
from daemon.http.connections import LimitedConnection
from daemon.http.listen_socket import BACKLOG, open_listener
from daemon.http.request_pacing import RequestPacing
from daemon.scans import scan_service
from tests.daemon.calibrations import apply_calibration
from tests.daemon.cell_under_test import Bench, serving, settings_for
from tests.daemon.clouds import LAZ, POSE, cloud, laz_of
from tests.support.waiting import LIMIT_S, eventually

QUICK = HttpLimits(head_s=0.3, head_bytes=10_000, idle_s=0.4, connections=40)
PATIENT = HttpLimits(head_s=600, head_bytes=10_000, connections=40)

Ends = tuple[asyncio.StreamReader, asyncio.StreamWriter]


@asynccontextmanager
async def connected(bench: Bench) -> AsyncIterator[Ends]:
    url = urlsplit(bench.url)
    reader, writer = await asyncio.open_connection(url.hostname, url.port)
    try:
        yield reader, writer
    finally:
        writer.transport.abort()  # not close, which first waits until what was written is sent
        with suppress(OSError):
            await writer.wait_closed()


async def told(reader: asyncio.StreamReader, within_s: float = LIMIT_S) -> dict[str, Any]:
    """The problem in an answer after which the connection ends."""
    answer = await asyncio.wait_for(reader.read(), within_s)
    head, _, body = answer.partition(b"\r\n\r\n")
    assert b"application/problem+json" in head, answer
    problem: dict[str, Any] = json.loads(body)
    assert f" {problem['status']} ".encode() in head.splitlines()[0]
    assert problem["fix"]
    return problem


def resident_bytes() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


@pytest.mark.parametrize("path", ["/events", "/live", "/camera/stream"])
async def test_head_of_a_stream_ends_with_its_head_and_the_next_request_is_answered(bench: Bench, path: str) -> None:
    async with connected(bench) as (reader, writer):
        for asked in (f"HEAD {path}", "GET /health"):
            writer.write(f"{asked} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
            head = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), LIMIT_S)
            assert head.startswith(b"HTTP/1.1 200 ")
    assert bench.application.metrics.requests["HEAD", 200] == 1


async def test_a_second_interrupt_waits_for_no_request(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("daemon.server.GRACE_S", 2 * LIMIT_S)
    async with connected(bench) as (reader, writer):
        writer.write(b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n")
        await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), LIMIT_S)
        bench.server.force_exit = True
        await asyncio.wait_for(bench.server.shutdown(), LIMIT_S)
        assert bench.server.server_state.tasks
        bench.server.force_exit = False


def test_no_answer_waits_for_the_client_to_acknowledge_its_first_half() -> None:
    with open_listener("127.0.0.1", 0) as listener, socket.create_connection(listener.getsockname()):
        accepted, _ = listener.accept()
        with accepted:
            assert accepted.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


def most_of_the_system() -> int:
    """How many connections Linux lets wait at any listening socket."""
    return int(Path("/proc/sys/net/core/somaxconn").read_text())


async def test_many_connections_may_wait_to_be_accepted(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path)) as bench:
        listener = bench.server._listener
        assert listener is not None
        longest_queue = int.from_bytes(listener.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 32)[28:], sys.byteorder)
        assert longest_queue == min(BACKLOG, most_of_the_system())


MALFORMED = [
    b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",  # a TLS hello
    b"GET\r\n\r\n",
    b"hello\r\n\r\n",
    b"GET / HTTP/1.1\r\nHost localhost\r\n\r\n",
    b"GET / HTTP/1.1\r\nHost: localhost\r\nContent-Length: -1\r\n\r\n",
    b"GET / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\n",
    b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1\r\nTransfer-Encoding: chunked\r\n\r\n",
    b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
    b"GET http://[::1 HTTP/1.1\r\nHost: localhost\r\n\r\n",
]


async def test_what_is_not_http_is_reported_as_a_problem_too(bench: Bench) -> None:
    for request in MALFORMED:
        async with connected(bench) as (reader, writer):
            writer.write(request)
            assert (await told(reader))["code"] == "request-malformed", request
    assert (await bench.client.get("/health")).status_code == 200


async def test_garbage_behind_a_request_does_not_fall_into_its_answer(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path)) as bench, connected(bench) as (reader, writer):
        writer.write(b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n")
        await asyncio.wait_for(reader.readuntil(b"what happens in the cell\n\n"), LIMIT_S)
        writer.write(b"\x00\x01garbage\r\n\r\n")
        bench.application.events.publish("test", {})
        assert b"400" not in await asyncio.wait_for(reader.readuntil(b"data: {}"), LIMIT_S)


@pytest.mark.parametrize("begun", [b"", b"\r\n", b"GET / HTTP/1.1\r\nHost: loc"])
async def test_a_head_that_never_ends_is_refused_in_time(tmp_path: Path, begun: bytes) -> None:
    async with (
        serving(settings_for(tmp_path), door=ConnectionLimiter(QUICK)) as bench,
        connected(bench) as (reader, writer),
    ):
        writer.write(begun)
        assert (await told(reader))["code"] == "request-too-slow"


async def test_bytes_that_trickle_do_not_keep_a_head_open(tmp_path: Path) -> None:
    async with (
        serving(settings_for(tmp_path), door=ConnectionLimiter(QUICK)) as bench,
        connected(bench) as (reader, writer),
    ):
        ended = asyncio.create_task(told(reader))
        while not ended.done():
            writer.write(b"x")
            await asyncio.sleep(0.02)
        assert ended.result()["code"] in ("request-too-slow", "request-malformed")


async def test_a_head_too_large_is_refused_before_it_ends(tmp_path: Path) -> None:
    async with (
        serving(settings_for(tmp_path), door=ConnectionLimiter(PATIENT)) as bench,
        connected(bench) as (reader, writer),
    ):
        writer.write(b"GET / HTTP/1.1\r\n")
        for k in range(12):
            writer.write(f"X-{k}: {'x' * 1000}\r\n".encode())
            await asyncio.sleep(0)
        assert (await told(reader))["code"] == "head-too-large"


async def test_a_client_that_sends_on_still_reads_why_it_was_refused(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path)) as bench, connected(bench) as (reader, writer):
        writer.write(b"POST /calibrate HTTP/1.1\r\nHost: localhost\r\nContent-Length: 30000000\r\n\r\n")
        for _ in range(30):
            writer.write(b" " * 1_000_000)
            await asyncio.wait_for(writer.drain(), LIMIT_S)
        assert (await told(reader))["code"] == "body-too-large"


async def is_cut_off_for_a_body_that_stops(bench: Bench) -> None:
    """Send half a body, and wait for the end of the connection: `idle_s` later."""
    async with connected(bench) as (reader, writer):
        writer.write(b"POST /calibrate HTTP/1.1\r\nHost: localhost\r\nContent-Length: 10\r\n\r\n{")
        with pytest.raises(ConnectionResetError):
            while await asyncio.wait_for(reader.read(), LIMIT_S):
                pass
            raise ConnectionResetError  # closed in order is as good


async def test_a_body_that_stops_coming_is_cut_off(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path), door=ConnectionLimiter(QUICK)) as bench:
        await is_cut_off_for_a_body_that_stops(bench)
        assert not bench.robot.goals


async def test_a_request_that_waits_for_its_answer_is_left_alone(tmp_path: Path) -> None:
    async with (
        serving(settings_for(tmp_path), door=ConnectionLimiter(QUICK)) as bench,
        connected(bench) as (reader, writer),
    ):
        writer.write(b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n")
        await asyncio.wait_for(reader.readuntil(b"what happens in the cell\n\n"), LIMIT_S)
        for _ in range(2):
            await is_cut_off_for_a_body_that_stops(bench)
        bench.application.events.publish("test", {})
        assert await asyncio.wait_for(reader.readuntil(b"data: {}"), LIMIT_S)


@pytest.mark.parametrize("points", [1_000, 100_000], ids=["parsed", "lent"])
async def test_an_upload_whose_answer_takes_long_is_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, points: int
) -> None:
    going_on, move_file = threading.Event(), scan_service.move_file

    def move_later(*arguments: Any, **named: Any) -> Any:
        assert going_on.wait(LIMIT_S)
        return move_file(*arguments, **named)

    monkeypatch.setattr(scan_service, "move_file", move_later)
    async with serving(settings_for(tmp_path), door=ConnectionLimiter(QUICK)) as bench:
        await apply_calibration(bench)
        content = laz_of(cloud(points))
        asked = bench.client.post("/register", params={"pose": POSE}, content=content, headers=LAZ)
        answering = asyncio.create_task(asked)
        for _ in range(3):
            await is_cut_off_for_a_body_that_stops(bench)
        going_on.set()
        assert (await answering).status_code == 200


@pytest.mark.skipif(sys.platform != "linux", reason="another system tells its memory otherwise")
async def test_clouds_that_are_announced_take_no_memory_before_they_come(bench: Bench) -> None:
    """A thread waits for each of four, a buffer of 1 MB for each of 61 others."""
    head = f"POST /register?pose={POSE} HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/octet-stream\r\n"
    await apply_calibration(bench)

    def lending() -> int:
        connections = cast(Iterable[LimitedConnection], bench.server.server_state.connections)
        return sum(one._own_buffer is not None or one._taken is not None for one in connections)

    async def announce(stack: AsyncExitStack, count: int) -> None:
        """Until so many clouds are announced."""
        for number in range(lending(), count):
            _, writer = await stack.enter_async_context(connected(bench))
            writer.write(f"{head}Content-Length: 6000000\r\n\r\n".encode() + struct.pack("<3f", 0, 0, 500))
            await eventually(partial(lambda before: lending() > before, number))

    async with AsyncExitStack() as stack:
        await announce(stack, 5)
        before = resident_bytes()
        await announce(stack, 65)
        assert resident_bytes() - before < 20e6


async def test_half_open_connections_make_room_for_whole_requests(tmp_path: Path) -> None:
    """Twice as many as there may be: the oldest are closed, and health answers all the while."""
    async with serving(settings_for(tmp_path), door=ConnectionLimiter(PATIENT)) as bench:
        url, writers = urlsplit(bench.url), []
        for _ in range(2 * PATIENT.connections):
            _, writer = await asyncio.open_connection(url.hostname, url.port)
            writer.write(b"GET / HTTP/1.1\r\nX-Half:")
            writers.append(writer)
        for _ in range(20):
            async with connected(bench) as (reader, writer):
                writer.write(b"GET /health HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
                assert b" 200 " in (await asyncio.wait_for(reader.read(), LIMIT_S)).splitlines()[0]
        assert len(bench.server.server_state.connections) <= PATIENT.connections
        for writer in writers:
            writer.close()


class HeldUp(RequestPacing):
    """A pacing in which nobody has a turn until the test gives it."""

    def __init__(self) -> None:
        super().__init__()
        self.waiting: list[tuple[bool, Callable[[], None]]] = []

    def take(self) -> bool:
        return False

    def wait(self, begin: Callable[[], None], *, urgent: bool) -> None:
        self.waiting.append((urgent, begin))


async def test_requests_wait_for_their_turn_and_an_abort_alone_is_urgent(tmp_path: Path) -> None:
    pacing = HeldUp()
    paths = ("GET /health", "GET /runs/none/abort", "POST /runs/none/finish", "POST /runs/none/abort")
    async with serving(settings_for(tmp_path), door=ConnectionLimiter(pacing=pacing)) as bench:
        wires = [await asyncio.open_connection("127.0.0.1", bench.client.base_url.port) for _ in paths]
        for path, (_, writer) in zip(paths, wires, strict=True):
            writer.write(
                f"{path} HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\nConnection: close\r\n\r\n".encode()
            )
        await eventually(lambda: len(pacing.waiting) == len(paths))
        assert sorted(urgent for urgent, _ in pacing.waiting) == [False, False, False, True]
        for _, begin in pacing.waiting:
            begin()
        answers = [await reader.read() for reader, _ in wires]
        assert [int(answer[9:12]) for answer in answers] == [200, 405, 404, 404]
        for _, writer in wires:
            writer.close()
