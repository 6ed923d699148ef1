"""The service manager is told, over its own kind of socket."""

import asyncio
from pathlib import Path

import pytest

from daemon.runtime.systemd import Systemd
from tests.daemon.cell_under_test import Bench
from tests.daemon.runtime.service_manager import Manager


def of(environment: dict[str, str]) -> Systemd:
    return Systemd.from_environment(environment, pid=42)


@pytest.mark.parametrize("abstract", [False, True])
async def test_states_arrive(tmp_path: Path, abstract: bool) -> None:
    name = f"{tmp_path}/notify"
    manager = Manager(f"\0{name}" if abstract else name)
    of({"NOTIFY_SOCKET": f"@{name}" if abstract else name}).notify("READY=1")
    assert await manager.hears() == "READY=1"
    manager.socket.close()


def test_without_a_manager_nothing_is_sent_and_a_deaf_one_does_not_stop_us(tmp_path: Path) -> None:
    assert of({}) == Systemd(None, None)
    of({}).notify("READY=1")
    of({"NOTIFY_SOCKET": f"{tmp_path}/nobody"}).notify("READY=1")


@pytest.mark.parametrize(
    ("environment", "watchdog_s"),
    [
        ({"WATCHDOG_USEC": "3000000"}, 3.0),
        ({"WATCHDOG_USEC": "3000000", "WATCHDOG_PID": "42"}, 3.0),
        ({"WATCHDOG_USEC": "3000000", "WATCHDOG_PID": "43"}, None),
        ({"WATCHDOG_USEC": "nonsense"}, None),
        ({"WATCHDOG_USEC": "0"}, None),
    ],
)
def test_the_watchdogs_period(environment: dict[str, str], watchdog_s: float | None) -> None:
    assert of(environment).watchdog_s == watchdog_s


async def test_the_watchdog_is_fed_while_work_answers_and_starves_when_it_hangs(tmp_path: Path) -> None:
    manager = Manager(f"{tmp_path}/notify")
    alive = asyncio.Event()

    async def work_is_alive() -> bool:
        return not alive.is_set()

    feeding = asyncio.create_task(Systemd(f"{tmp_path}/notify", 0.03).feed_watchdog(work_is_alive))
    assert [await manager.hears() for _ in range(3)] == ["WATCHDOG=1"] * 3
    alive.set()
    with pytest.raises(TimeoutError):
        while True:
            await manager.hears(0.1)
    feeding.cancel()
    manager.socket.close()


async def test_a_hung_worker_starves_the_watchdog(bench: Bench) -> None:
    """It is the daemon's own work that feeds: its store's thread, and jobs that end."""
    application = bench.application
    assert await application.work_is_alive()
    application.workers._began_s[1] = application.clock.monotonic_s() - 3600
    assert not await application.work_is_alive()
    application.workers._began_s.clear()
