"""Requests and connections leave nothing for the garbage collector, whose turns would keep an abort waiting."""

import asyncio
import gc
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from daemon.api.middleware import disconnects
from tests.daemon.api.raw_requests import RawRequest
from tests.daemon.cell_under_test import Bench, Parts, serving, settings_for
from tests.daemon.fakes import FakeRobot
from tests.daemon.http.tls_files import certificate, trusting
from tests.support.waiting import LIMIT_S, eventually

ROUNDS = 20
GET = b"GET %b HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n"


@contextmanager
def uncollected(found: Counter[str]) -> Iterator[None]:
    """Count what only the garbage collector could free after the block, by type."""
    gc.collect()
    gc.disable()
    try:
        yield
        gc.set_debug(gc.DEBUG_SAVEALL)
        gc.collect()
        found.update(type(one).__name__ for one in gc.garbage)
    finally:
        gc.set_debug(0)
        gc.garbage.clear()
        gc.enable()


@pytest.mark.parametrize("path", [b"/robot", b"/nowhere"])
@pytest.mark.parametrize("secured", [False, True], ids=["plain", "tls"])
async def test_requests_leave_no_cycles(tmp_path: Path, path: bytes, secured: bool) -> None:
    server = certificate(tmp_path / "tls") if secured else {}
    async with serving(settings_for(tmp_path / "store", server=server)) as bench:
        tls = trusting(tmp_path / "tls") if secured else None
        port = urlsplit(bench.url).port

        async def ask() -> None:
            reader, writer = await asyncio.open_connection("127.0.0.1", port, ssl=tls)
            writer.write(GET % path)
            async with asyncio.timeout(LIMIT_S):
                assert await reader.read()
            writer.close()
            await writer.wait_closed()

        await ask()
        found: Counter[str] = Counter()
        with uncollected(found):
            for _ in range(ROUNDS):
                await ask()
        assert found["RequestResponseCycle"] + found["LimitedConnection"] + found["Client"] < ROUNDS / 2, found


async def test_clients_that_hang_up_leave_no_cycles(tmp_path: Path) -> None:
    robot = FakeRobot()
    async with serving(settings_for(tmp_path), Parts(robot)) as bench:
        await (await RawRequest.send(bench, "GET /health")).hang_up()
        silent = asyncio.Event()
        bench.application.readings.robot._source = silent.wait  # type: ignore[assignment] # nobody gets an answer
        found: Counter[str] = Counter()
        before = len(asyncio.all_tasks())
        with uncollected(found):
            asked = [await RawRequest.send(bench, "GET /robot") for _ in range(ROUNDS)]
            await eventually(lambda: len(asyncio.all_tasks()) >= before + ROUNDS)
            for one in asked:
                await one.hang_up()
            await eventually(lambda: len(asyncio.all_tasks()) <= before + 1)
            del asked, one
        silent.set()
        assert found["Client"] < ROUNDS / 2, found


async def test_answers_that_were_listened_for_leave_no_cycles(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """A request that takes long has a task that listens for its client's disconnect."""
    monkeypatch.setattr(disconnects, "WATCH_AFTER_S", 0.0)
    found: Counter[str] = Counter()
    await bench.client.get("/robot")
    with uncollected(found):
        for _ in range(ROUNDS):
            assert (await bench.client.get("/runs")).status_code == 200
    assert found["Client"] < ROUNDS / 2, found
