"""Large clouds in the hands of threads: as through the event loop, and no thread outlives its client or the daemon."""

import asyncio
import socket
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import numpy as np
import pytest

from daemon.api.streaming.cloud_response import PIECE_BYTES
from daemon.http.connection_limiter import MAX_TAKEN, ConnectionLimiter, HttpLimits
from tests.daemon.calibrations import apply_calibration
from tests.daemon.cell_under_test import Bench, serving, settings_for
from tests.daemon.clouds import OCTETS, POSE, cloud, in_base
from tests.support.waiting import LIMIT_S, eventually

POINTS = 200_000
HALF = 6 * POINTS

Ends = tuple[asyncio.StreamReader, asyncio.StreamWriter]


@asynccontextmanager
async def half_sent(bench: Bench, content: bytes) -> AsyncIterator[Ends]:
    """A connection over which the first half of a cloud was sent."""
    url = urlsplit(bench.url)
    reader, writer = await asyncio.open_connection(url.hostname, url.port)
    head = f"POST /register?pose={POSE} HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/octet-stream\r\n"
    writer.write(f"{head}Content-Length: {len(content)}\r\n\r\n".encode() + content[:HALF])
    try:
        yield reader, writer
    finally:
        writer.transport.abort()  # not close, which first waits until what was written is sent
        with suppress(OSError):
            await writer.wait_closed()


async def moved_points(reader: asyncio.StreamReader) -> np.ndarray:
    assert b" 200 " in (await reader.readuntil(b"\r\n\r\n")).splitlines()[0]
    return np.frombuffer(await reader.readexactly(12 * POINTS), "<f4").reshape(-1, 3)


async def test_as_many_clouds_as_there_are_threads_and_one_more(tmp_path: Path) -> None:
    """The last goes through the event loop; all answers are right, and their connections take another question."""
    clouds = [cloud(POINTS, seed=seed) for seed in range(MAX_TAKEN + 1)]
    door = ConnectionLimiter()
    async with serving(settings_for(tmp_path), door=door) as bench, AsyncExitStack() as stack:
        await apply_calibration(bench)
        ends: list[Ends] = []
        for number, points in enumerate(clouds, 1):
            ends.append(await stack.enter_async_context(half_sent(bench, points.astype("<f4").tobytes())))
            await asyncio.wait_for(ends[-1][0].readuntil(b"HTTP/1.1"), LIMIT_S)
            assert door.taken == min(number, MAX_TAKEN)
        for (reader, writer), points in zip(ends, clouds, strict=True):
            writer.write(points.astype("<f4").tobytes()[HALF:] + b"GET /health HTTP/1.1\r\nHost: localhost\r\n\r\n")
            async with asyncio.timeout(LIMIT_S):
                np.testing.assert_allclose(await moved_points(reader), in_base(points), atol=2e-3)
                assert b" 200 " in (await reader.readuntil(b"\r\n\r\n")).splitlines()[0]
        assert door.taken == 0


@pytest.mark.parametrize(("leaves", "idle_s"), [(False, 0.4), (True, 600.0)], ids=["sends no more", "is gone"])
async def test_a_client_that_sends_no_more_leaves_no_thread(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, leaves: bool, idle_s: float
) -> None:
    door = ConnectionLimiter(HttpLimits(idle_s=idle_s))
    async with serving(settings_for(tmp_path), door=door) as bench:
        await apply_calibration(bench)
        async with half_sent(bench, cloud(POINTS).astype("<f4").tobytes()) as (reader, writer):
            if leaves:
                await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), LIMIT_S)
                writer.transport.get_extra_info("socket").shutdown(socket.SHUT_WR)
            assert len(await asyncio.wait_for(reader.read(-1), LIMIT_S)) < 12 * POINTS
            await eventually(lambda: not door.taken)
        assert (await bench.client.get("/health")).status_code == 200
        assert "a streamed cloud was cut off: the client disconnected" in caplog.text


async def test_the_daemon_stops_while_a_thread_waits_for_a_client(tmp_path: Path) -> None:
    door = ConnectionLimiter()
    async with AsyncExitStack() as stack:
        async with serving(settings_for(tmp_path), door=door) as bench:
            await apply_calibration(bench)
            reader, _ = await stack.enter_async_context(half_sent(bench, cloud(POINTS).astype("<f4").tobytes()))
            await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), LIMIT_S)
            assert door.taken == 1
        assert door.taken == 0


async def test_an_answer_is_whole_though_more_than_the_body_was_sent_and_it_is_read_late(tmp_path: Path) -> None:
    """What follows the body of a connection that closes is read, or the system would drop the rest of the answer."""
    content = cloud(POINTS).astype("<f4").tobytes()
    head = f"POST /register?pose={POSE} HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/octet-stream\r\n"
    door = ConnectionLimiter()
    async with serving(settings_for(tmp_path), door=door) as bench:
        await apply_calibration(bench)
        url, loop = urlsplit(bench.url), asyncio.get_running_loop()
        with socket.socket() as client:
            client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 16)
            client.setblocking(False)
            await loop.sock_connect(client, (url.hostname, url.port))
            whole = f"{head}Connection: close\r\nContent-Length: {len(content)}\r\n\r\n".encode() + content
            sending = asyncio.create_task(loop.sock_sendall(client, whole + b"\r\n\r\n"))
            received = bytearray()
            while bench.application.metrics.registered_points < POINTS:
                if not (piece := await asyncio.wait_for(loop.sock_recv(client, 1 << 14), LIMIT_S)):
                    break  # it was all read before the daemon had counted it
                received += piece
                await asyncio.sleep(0)  # for the daemon, whose loop it is
            await sending
            for _ in range(20):  # turns of the loop that is the daemon's as well, in which it closes
                await asyncio.sleep(0)
            with suppress(ConnectionResetError):
                while piece := await asyncio.wait_for(loop.sock_recv(client, 1 << 14), LIMIT_S):
                    received += piece
        assert len(received.partition(b"\r\n\r\n")[2]) == len(content)


async def test_a_repetition_with_a_key_is_held_against_the_whole_cloud(tmp_path: Path) -> None:
    url, headers = f"/register?pose={POSE}", {**OCTETS, "idempotency-key": "a-1"}
    first, other = (cloud(POINTS, seed=seed).astype("<f4").tobytes() for seed in (1, 2))
    async with serving(settings_for(tmp_path), door=ConnectionLimiter()) as bench:
        await apply_calibration(bench)

        async def answered(content: bytes) -> bytes:
            """The answer, when no request with the key is in progress any more."""
            while (answer := await bench.client.post(url, content=content, headers=headers)).status_code == 409:
                pass
            return answer.content

        assert await answered(first) == await answered(first)
        with pytest.raises(httpx.RemoteProtocolError):  # the answer has begun when the last byte shows it
            await answered(other)


async def test_a_cloud_whose_record_is_larger_than_a_piece_is_answered_whole(tmp_path: Path) -> None:
    count, width = 6, PIECE_BYTES // 4 + 1000
    records = np.zeros(count, [("xyz", "<f4", 3), ("spectrum", "<f4", width)])
    points = cloud(count)
    records["xyz"], records["spectrum"] = points, np.arange(count)[:, None]
    header = (
        f"VERSION .7\nFIELDS x y z spectrum\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 {width}\nWIDTH {count}\n"
        f"HEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\nDATA binary\n"
    )
    async with serving(settings_for(tmp_path)) as bench:
        await apply_calibration(bench)
        answer = await bench.client.post(
            "/register", params={"pose": POSE}, content=header.encode() + records.tobytes(),
            headers={"Content-Type": "application/x-pcd"},
        )  # fmt: skip
        moved = np.frombuffer(answer.content[-records.nbytes :], records.dtype)
        np.testing.assert_allclose(moved["xyz"], in_base(points), atol=2e-3)
        assert (moved["spectrum"] == records["spectrum"]).all()
