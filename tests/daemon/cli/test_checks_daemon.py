"""`handeyed check` beside a daemon: the same file, the file as it was, another file, and somebody else at the port."""

import asyncio
import socket
import threading
from pathlib import Path

import pytest

from daemon.cli.checks import check_daemon
from daemon.cli.rest_client import RunningService
from daemon.config.settings import Settings, SettingsFile
from daemon.model.check_result import CheckResult
from tests.daemon.cell_under_test import serving, settings_for
from tests.support.waiting import LIMIT_S

OURS = SettingsFile("/etc/handeyed/handeyed.toml", "1" * 64)


@pytest.fixture(autouse=True)
def no_service(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("daemon.cli.checks.running_service", lambda: None)
    monkeypatch.setattr("daemon.cli.checks.MAX_ANSWER_S", LIMIT_S)  # a busy machine answers late


def at(settings: Settings, url: str) -> Settings:
    return settings.model_copy(
        update={"server": settings.server.model_copy(update={"port": int(url.rpartition(":")[2])})}
    )


async def check(settings: Settings, loaded: SettingsFile | None) -> list[CheckResult] | None:
    return await asyncio.to_thread(check_daemon, settings, loaded)


@pytest.mark.parametrize(
    ("checked", "found", "what_to_do"),
    [
        (OURS, None, ""),
        (SettingsFile(OURS.file, "2" * 64), "with this file as it was when it started", "systemctl restart handeyed"),
        (
            SettingsFile("/tmp/other.toml", "2" * 64),
            f"with {OURS.file}, which is another than this file",
            "check that one",
        ),
    ],
)
async def test_the_daemon_s_file_is_compared_with_the_one_that_is_checked(
    tmp_path: Path, checked: SettingsFile, found: str | None, what_to_do: str
) -> None:
    settings = settings_for(tmp_path)
    async with serving(settings, settings_file=OURS) as bench:
        results = await check(at(settings, bench.url), checked)
        assert results is not None
        if found is None:
            assert [(row.name, row.ok) for row in results] == [("daemon", True), ("cell", True)]
            assert results[0].what.endswith("with this file")
            return
        (only,) = results
        assert not only.ok
        assert found in only.what
        assert "no device was asked" in only.what
        assert what_to_do in only.fix


async def test_the_service_of_this_machine_is_found_at_another_port(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file with another port would otherwise open the robot that the service holds."""
    settings = settings_for(tmp_path)
    async with serving(settings, settings_file=OURS) as bench:
        monkeypatch.setattr("daemon.cli.checks.running_service", lambda: RunningService(bench.url, None, None))
        with socket.create_server(("127.0.0.1", 0)) as free:
            port = free.getsockname()[1]
        results = await check(at(settings, f"http://127.0.0.1:{port}"), SettingsFile("/tmp/other.toml", "2" * 64))
        assert results is not None
        assert OURS.file in results[0].what


async def test_nobody_there_leaves_the_devices_to_the_check(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    assert await check(at(settings_for(tmp_path), f"http://127.0.0.1:{port}"), OURS) is None


async def test_somebody_else_at_the_port_is_said_and_no_device_is_opened(tmp_path: Path) -> None:
    """As a daemon that speaks TLS does to a file without: the devices may be held by it."""
    with socket.create_server(("127.0.0.1", 0)) as other:

        def hang_up() -> None:
            connection, _ = other.accept()
            connection.recv(1)
            connection.close()

        thread = threading.Thread(target=hang_up)
        thread.start()
        results = await check(at(settings_for(tmp_path), f"http://127.0.0.1:{other.getsockname()[1]}"), OURS)
        thread.join()
    assert results is not None
    assert [row.ok for row in results] == [False]
    assert "but not as a daemon with these settings" in results[0].what
