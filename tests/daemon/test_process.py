"""The daemon as a process sees the world: its port, its announcement, its log."""

import asyncio
import json
import logging
import os
import socket
from pathlib import Path

import pytest

from daemon.config.settings import Settings
from daemon.errors import PortTaken
from daemon.http.listen_socket import open_listener
from daemon.runtime.logs import OneLineFormatter, about_run
from daemon.runtime.workers import Workers
from daemon.server import make_announcer
from tests.daemon.cell_under_test import serving, settings_for


def test_a_port_that_is_taken_is_reported_with_what_to_do() -> None:
    with (
        socket.create_server(("127.0.0.1", 0)) as other,
        pytest.raises(PortTaken, match=r"address already in use.*ss -ltnp"),
    ):
        open_listener("127.0.0.1", other.getsockname()[1])


def test_port_0_takes_any_also_on_ipv6() -> None:
    for host in ("127.0.0.1", "::1"):
        with open_listener(host, 0) as listener:
            assert listener.getsockname()[1] > 0


def test_the_announcement_says_where_and_who(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    make_announcer(tmp_path / "ready.json")("http://127.0.0.1:1")
    assert json.loads((tmp_path / "ready.json").read_text()) == {"url": "http://127.0.0.1:1", "pid": os.getpid()}
    assert capsys.readouterr().out == "handeyed listens on http://127.0.0.1:1\n"


def test_a_log_record_is_one_line_with_its_run_whatever_it_says() -> None:
    record = logging.makeLogRecord({"name": "x", "levelname": "INFO", "msg": "two\nlines \x1b[31m red"})
    with about_run("r7"):
        line = OneLineFormatter().format(record)
    assert line == "INFO run=r7 request=- x: two\\nlines \\x1b[31m red"


async def test_the_oldest_job_is_known_while_it_runs(tmp_path: Path) -> None:
    settings: Settings = settings_for(tmp_path)
    async with serving(settings) as bench:
        workers: Workers = bench.application.workers
        assert workers.oldest_job_s() == 0
        begun, ends = asyncio.Event(), asyncio.Event()
        loop = asyncio.get_running_loop()

        def job() -> None:
            loop.call_soon_threadsafe(begun.set)
            asyncio.run_coroutine_threadsafe(ends.wait(), loop).result()

        working = asyncio.create_task(workers.run(job))
        await begun.wait()
        assert workers.oldest_job_s() > 0
        ends.set()
        await working
        assert workers.oldest_job_s() == 0
