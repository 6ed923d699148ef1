"""The running daemon: what is started, in which order, and how it ends."""

import asyncio
import logging
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Protocol

from daemon.cell.cell import Cell
from daemon.config.settings import Settings
from daemon.drift.monitor import DriftMonitor
from daemon.errors import StorageError
from daemon.operations import Operations
from daemon.runs.supervisor import MAX_STEP_S, Supervisor
from daemon.runtime.clock import Clock
from daemon.runtime.event_bus import EventBus
from daemon.runtime.metrics import Metric, Metrics
from daemon.runtime.systemd import Systemd
from daemon.runtime.workers import Workers
from daemon.scans.scan_service import ScanService
from daemon.store.key_service import KeyService
from daemon.store.store import Store

log = logging.getLogger(__name__)

MAX_LINK_WAIT_S = 2.0
"""Devices that are there answer well within this; one that is not must not keep the daemon from starting."""

MAX_LAST_EVENT_S = 0.8
"""Stopping and disarming an arm that answers takes a few milliseconds."""

ANCHOR_S = 10.0
"""How much of the audit log's end is without an anchor at most."""

MAX_JOB_S = 600.0
"""No detection or solution of a run takes ten minutes: a job that does hangs."""


MAX_STUCK_S = MAX_STEP_S + 60.0
"""A run that takes longer over a step is ended; one that does not end then either hangs."""


class BackgroundService(Protocol):
    """Something that works beside the REST interface for as long as the daemon runs."""

    async def start(self) -> None: ...

    async def stop(self) -> None: ...


class WarningSource(Protocol):
    """A companion with something to say in GET /ready."""

    def warnings(self) -> list[str]:
        """For GET /ready: what should be looked after though work goes on."""
        ...


class MetricSource(Protocol):
    """A companion that counts."""

    def families(self) -> Iterable[Metric]:
        """For GET /metrics."""
        ...


@dataclass(eq=False)
class Application:
    """Every owner of state, handed in by the composition root."""

    settings: Settings
    clock: Clock
    cell: Cell
    store: Store
    events: EventBus
    workers: Workers
    supervisor: Supervisor
    operations: Operations
    scans: ScanService
    metrics: Metrics
    drift: DriftMonitor
    key_service: KeyService
    systemd: Systemd
    services: tuple[BackgroundService, ...] = ()
    warning_sources: tuple[WarningSource, ...] = ()
    metric_sources: tuple[MetricSource, ...] = ()
    _started_s: float = field(default=0.0, init=False)
    _stopping: asyncio.Task[None] | None = field(default=None, init=False)
    _watchdog: asyncio.Task[None] | None = field(default=None, init=False)
    _anchoring: asyncio.Task[None] | None = field(default=None, init=False)

    async def start(self) -> None:
        """Tell off what an earlier daemon left behind, and feed the watchdog. Nothing moves."""
        self._started_s = self.clock.monotonic_s()
        await self.events.recover()
        await self.supervisor.recover()
        await self.scans.recover()
        await self._log_setup_code()
        await self.cell.wait_for_links(MAX_LINK_WAIT_S)
        for companion in self.services:
            await companion.start()
        self._anchoring = asyncio.create_task(self._anchor_audit_log())
        self._watchdog = asyncio.create_task(self.systemd.feed_watchdog(self.work_is_alive))

    def begin_stop(self, by: str) -> None:
        """End the run and every event stream; may be called again, and from a signal handler's callback."""
        if self._stopping is None:
            log.info("stopping: %s", by)
            self.systemd.notify("STOPPING=1")
            self._stopping = asyncio.create_task(self._end_work(by))

    async def _end_work(self, by: str) -> None:
        """The run's end is told to every listener before their streams end, but they do not wait long for it."""
        ending = asyncio.create_task(self.supervisor.stop(by))
        await asyncio.wait([ending], timeout=MAX_LAST_EVENT_S)
        self.events.close()
        await ending

    async def stop(self) -> None:
        """The arm is at rest, everything is stored, every device is closed."""
        self.begin_stop("the end of the daemon")
        assert self._stopping is not None
        await self._stopping
        for companion in reversed(self.services):
            await companion.stop()
        for task in (self._watchdog, self._anchoring):
            if task is not None:
                task.cancel()
                with suppress(asyncio.CancelledError):
                    await task
        self.scans.registration_jobs.stop()
        self.workers.close()
        await self.cell.close()
        await self.events.flush()
        with suppress(StorageError):
            if (anchor := await self.store.audit.anchor()) is not None:
                log.info("the audit log ends with row %d, %s", anchor.sequence, anchor.hash)
        await self.store.close()

    async def _log_setup_code(self) -> None:
        if await self.store.access_keys.any_ever():
            return
        whoever = "whoever is on this machine may do everything" if self.settings.server.loopback else "nobody gets in"
        log.info(
            "there are no keys yet: %s. The first, an admin's: 'handeyed keys add', or POST /setup with the code %s",
            whoever, self.key_service.code.text,
        )  # fmt: skip

    async def _anchor_audit_log(self) -> None:
        """Until cancelled. What is written down beside the log cannot be cut off from its end unnoticed."""
        while True:
            await asyncio.sleep(ANCHOR_S)
            try:
                await self.store.audit.anchor()
            except StorageError as error:
                log.warning("the audit log's anchor could not be written: %s", error)

    def uptime_s(self) -> float:
        return self.clock.monotonic_s() - self._started_s

    async def work_is_alive(self) -> bool:
        """The event loop, the store's thread, the workers and the run in progress do their work."""
        with suppress(StorageError):  # it answers, if badly: a restart would not mend the disk
            await self.store.ping()
        return self.workers.oldest_job_s() < MAX_JOB_S and self.supervisor.silent_s() < MAX_STUCK_S
