"""The running daemon: its cameras, and its services, which it starts and stops in order."""

import asyncio
import logging
from collections.abc import Callable, Coroutine, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from calibration.sentences.sentence import Sentence
from daemon.access.service_key import ServiceKey
from daemon.cell.cell import Cell
from daemon.cell.device_watch import DeviceWatch
from daemon.cell.readings import CellReadings
from daemon.config.settings import Settings, SettingsFile
from daemon.drift.monitor import DriftMonitor
from daemon.errors import NotFound, NotInstalled, StorageError
from daemon.http.listen_socket import late_addresses
from daemon.operations import Operations
from daemon.runs.supervisor import MAX_STEP_S, Supervisor
from daemon.runtime.clock import Clock
from daemon.runtime.event_bus import EventBus
from daemon.runtime.logs import RecentLog
from daemon.runtime.loop_monitor import EventLoopMonitor
from daemon.runtime.metrics import Metrics
from daemon.runtime.shared_reading import RecentReading
from daemon.runtime.systemd import Systemd
from daemon.runtime.tasks import SectionService, Service, end_task
from daemon.runtime.workers import Workers
from daemon.scans.scan_service import ScanService
from daemon.sessions.look import Look
from daemon.sessions.pictures import LivePictures
from daemon.store.access_keys import KeyService
from daemon.store.key_watch import KeyWatch
from daemon.store.sign_in import SignIn
from daemon.store.store import Store


@dataclass(eq=False)
class CellCamera:
    """One camera: its runs, pictures and drift chart. `settings`: with this camera in [camera], replaced by a reload.

    `obstacles`: reasons why a run with robot and this camera could not start now.
    """

    name: str
    settings: Settings
    operations: Operations
    pictures: LivePictures
    looks: RecentReading[Look]
    drift: DriftMonitor
    obstacles: RecentReading[tuple[str, ...]]


log = logging.getLogger(__name__)

MAX_LINK_WAIT_S = 2.0
"""How long the start waits for devices; connected ones answer well within this."""

MAX_LAST_EVENT_S = 1.5
"""How long event streams stay open for the run's end; stopping and disarming normally take milliseconds."""

MAX_JOB_S = 600.0
"""A worker job that takes longer hangs: no detection or solution takes ten minutes."""


MAX_STUCK_S = MAX_STEP_S + 60.0
"""A run without a step for longer hangs: the supervisor should have ended it after MAX_STEP_S."""


Kind = TypeVar("Kind")


@dataclass(frozen=True)
class LateAddresses(Service):
    """Warns of each address in `hosts()`, by section of the settings in force, that this machine does not have yet."""

    hosts: Callable[[], Mapping[str, str]]

    def warnings(self) -> list[str]:
        return late_addresses(self.hosts())


@dataclass(eq=False)
class Application:
    """All parts of the daemon, built by `composition`.

    `cameras`: that of [camera] first.
    `services`: started in their order and stopped in reverse; their warnings have it, too, the gravest first.
    `workers` compute for runs and nothing else; `merge_workers` merge and register scans, one at a time;
    `service_workers` do what is left: uploads, encoding, lists, the drift chart. `setup_file`: what the first set-up
    writes, before the daemon ends and begins anew; None for a cell that is set up.
    """

    settings: Settings
    settings_file: SettingsFile | None
    clock: Clock
    new_id: Callable[[], str]
    cell: Cell
    readings: CellReadings
    store: Store
    events: EventBus
    workers: Workers
    service_workers: Workers
    merge_workers: Workers
    supervisor: Supervisor
    operations: Operations
    scans: ScanService
    metrics: Metrics
    cameras: tuple[CellCamera, ...]
    key_service: KeyService
    sign_in: SignIn
    key_watch: KeyWatch
    device_watch: DeviceWatch
    systemd: Systemd
    service_key: ServiceKey | None
    loop_monitor: EventLoopMonitor
    recent_log: RecentLog
    services: tuple[Service, ...] = ()
    reload: Callable[[], Coroutine[Any, Any, None]] | None = None
    sections: Mapping[str, SectionService] = field(default_factory=dict)
    setup_file: Path | None = None
    begins_anew: bool = False
    end: Callable[[], None] = lambda: None
    _started_s: float = field(default=0.0, init=False)
    _stopping: asyncio.Task[None] | None = field(default=None, init=False)
    _watchdog: asyncio.Task[None] | None = field(default=None, init=False)

    def camera(self, name: str | None) -> CellCamera:
        """The camera of that name, without one that of [camera]. Raises NotFound."""
        found = next((camera for camera in self.cameras if name in (None, camera.name)), None)
        if found is None:
            fix = Sentence("choose-of-settings", names=[camera.name for camera in self.cameras])
            raise NotFound(Sentence("no-such-camera", name=name), fix)
        return found

    def service(self, kind: type[Kind]) -> Kind:
        """The background service of that class; there is one."""
        return next(service for service in self.services if isinstance(service, kind))

    def section(self, name: str) -> SectionService:
        """What serves that section of the settings. Raises NotInstalled."""
        if name not in self.sections:
            raise NotInstalled(f"this daemon has no extension for [{name}]", f"take [{name}] out of the settings")
        return self.sections[name]

    def warnings(self) -> list[str]:
        """Conditions that need attention although work goes on, for GET /ready."""
        return [warning for service in self.services for warning in service.warnings()]

    async def start(self) -> None:
        """End runs that the previous process left unfinished, start services and watchdog. Commands no motion."""
        self._started_s = self.clock.monotonic_s()
        try:
            await self.events.recover()
            await self.supervisor.recover(lambda name: self.settings.of_camera(name).calibration.policy == "auto")
            await self.scans.recover()
        except StorageError as error:
            if self.store.fault is None:
                raise
            log.error("what the previous process left unfinished was not looked at: %s", error)
        await self._log_setup_code()
        await self.cell.wait_for_links(MAX_LINK_WAIT_S)
        logging.getLogger().addHandler(self.recent_log)
        for service in self.services:
            await service.start()
        self._watchdog = asyncio.create_task(self.systemd.feed_watchdog(self.work_is_alive))

    def begin_stop(self, by: str) -> None:
        """Begin to end the run and the event streams. May be called repeatedly, also from a signal's callback."""
        if self._stopping is None:
            log.info("stopping: %s", by)
            self.systemd.notify("STOPPING=1")
            self._stopping = asyncio.create_task(self._end_work(by))

    async def _end_work(self, by: str) -> None:
        """Stop the run, then close the event streams: after the run's end was published, at the latest after 1.5 s."""
        ending = asyncio.create_task(self.supervisor.stop(by))
        await asyncio.wait([ending], timeout=MAX_LAST_EVENT_S)
        self.events.close()
        await ending

    async def stop(self) -> None:
        """Stop the arm and the services, store what is pending, close the devices."""
        self.begin_stop(Sentence("by-daemon-end"))
        assert self._stopping is not None
        await self._stopping
        for service in reversed(self.services):
            await service.stop()
        logging.getLogger().removeHandler(self.recent_log)
        await end_task(self._watchdog)
        self.scans.registration_jobs.stop()
        for workers in (self.workers, self.service_workers, self.merge_workers):
            workers.close()
        await self.cell.close()
        await self.events.flush()
        with suppress(StorageError):
            if (anchor := await self.store.audit.anchor()) is not None:
                log.info("the audit log ends with row %d, %s", anchor.sequence, anchor.hash)
        await self.store.close()

    async def _log_setup_code(self) -> None:
        if await self.store.access_keys.any_ever():
            return
        allowed = "whoever is on this machine may do everything" if self.service_key is None else (
            "whoever is on this machine may look, and only root and the service's group move the arm"
        )  # fmt: skip
        whoever = allowed if self.settings.server.loopback else "nobody gets in from elsewhere"
        log.info(
            "there are no keys yet: %s. The first, an admin's: 'handeyed keys add', or POST /setup with the code %s",
            whoever, self.key_service.code.text,
        )  # fmt: skip

    def uptime_s(self) -> float:
        return self.clock.monotonic_s() - self._started_s

    async def work_is_alive(self) -> bool:
        """True while the store's thread answers and neither a worker job nor the run in progress hangs."""
        with suppress(StorageError):  # it answers; a restart would not repair the disk
            await self.store.ping()
        return self.workers.oldest_job_s() < MAX_JOB_S and self.supervisor.silent_s() < MAX_STUCK_S
