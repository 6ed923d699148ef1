"""The watchdog is fed by the work itself: a worker, or the store's thread, that hangs is noticed by the manager."""

import asyncio
import logging
import threading
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import pytest

from daemon.application import Application
from daemon.cell.cell import Devices
from daemon.composition import build
from daemon.errors import CellNotReady
from daemon.runs.run_log import RunLog, RunResult
from daemon.runs.supervisor import RunPlan
from daemon.runtime.systemd import Systemd
from tests.daemon.cell_under_test import Parts, settings_for
from tests.daemon.runtime.service_manager import Manager

FED_EVERY_S = 0.05


@asynccontextmanager
async def watched(folder: Path) -> AsyncIterator[tuple[Application, Manager]]:
    """A daemon whose manager wants to be told every 0.15 s."""
    manager = Manager(f"{folder}/notify")
    parts = Parts()
    devices = Devices(parts.robot, parts.camera, parts.scanner)
    systemd = Systemd(f"{folder}/notify", 3 * FED_EVERY_S)
    application = build(settings_for(folder / "store"), lambda _settings, _clock: devices, systemd=systemd)
    await application.start()
    try:
        yield application, manager
    finally:
        await application.stop()
        manager.socket.close()


async def starves(manager: Manager) -> None:
    """Nothing comes for ten times as long as between two feedings."""
    with pytest.raises(TimeoutError):
        while True:
            await manager.hears(10 * FED_EVERY_S, of="WATCHDOG")


async def test_a_hung_worker_starves_the_watchdog_and_is_reported_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("daemon.application.MAX_JOB_S", 0.2)
    async with watched(tmp_path) as (application, manager):
        assert [await manager.hears(of="WATCHDOG") for _ in range(3)] == ["WATCHDOG=1"] * 3
        hangs = threading.Event()
        job = asyncio.create_task(application.workers.run(hangs.wait))
        try:
            await starves(manager)
        finally:
            hangs.set()
        await job
        assert await manager.hears(of="WATCHDOG") == "WATCHDOG=1"
        told = [record for record in caplog.records if "the watchdog is not fed" in record.message]
        assert [record.levelno for record in told] == [logging.ERROR]


async def test_a_run_that_hangs_and_cannot_even_be_stopped_starves_the_watchdog(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("daemon.runs.supervisor.MAX_STEP_S", 0.1)
    monkeypatch.setattr("daemon.application.MAX_STUCK_S", 0.2)
    async with watched(tmp_path) as (application, manager):
        released = asyncio.Event()

        async def deaf(_log: RunLog) -> RunResult:
            while not released.is_set():
                with suppress(asyncio.CancelledError):
                    await released.wait()
            raise CellNotReady(("it was let go",))

        async def prepare() -> RunPlan:
            return RunPlan(1, deaf)

        run = await application.supervisor.start("calibration", {}, prepare)
        try:
            await starves(manager)
        finally:
            released.set()
        assert (await application.supervisor.wait(run.id, 5)).state == "failed"
        assert await manager.hears(of="WATCHDOG") == "WATCHDOG=1"


async def test_a_hung_store_starves_the_watchdog(tmp_path: Path) -> None:
    async with watched(tmp_path) as (application, manager):
        await manager.hears(of="WATCHDOG")
        hangs = threading.Event()
        job = asyncio.create_task(application.store._database.run(hangs.wait, tmp_path))
        try:
            await starves(manager)
        finally:
            hangs.set()
        await job
        assert await manager.hears(of="WATCHDOG") == "WATCHDOG=1"


async def test_a_hung_event_loop_feeds_nobody(tmp_path: Path) -> None:
    async with watched(tmp_path) as (_, manager):
        await manager.hears(of="WATCHDOG")
        while True:
            try:
                manager.socket.recv(4096)
            except BlockingIOError:
                break
        threading.Event().wait(10 * FED_EVERY_S)  # the loop itself is what hangs
        with pytest.raises(BlockingIOError):
            manager.socket.recv(4096)
