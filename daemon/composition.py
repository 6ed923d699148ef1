"""Composition root: builds the application from its settings."""

import faulthandler
import logging
import os
import random
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import uvloop

from daemon.access.service_key import ServiceKey
from daemon.api.extension import Extensions
from daemon.application import Application, CellCamera, LateAddresses
from daemon.cell.arm_in_cell import ArmInCell
from daemon.cell.cell import Cell, Devices
from daemon.cell.device_watch import DeviceWatch
from daemon.cell.devices import open_devices, open_exposure_control
from daemon.cell.motion_rules import MotionRules
from daemon.cell.readings import CellReadings
from daemon.config.settings import MAIN_CAMERA, OF_SERVICES, Settings, SettingsFile
from daemon.drift.monitor import DriftMonitor
from daemon.drift.schedule import DriftSchedule
from daemon.operations import Operations, no_further_sensors
from daemon.runs.supervisor import Supervisor
from daemon.runtime.clock import Clock, time_ordered_id
from daemon.runtime.event_bus import EventBus
from daemon.runtime.failpoints import NO_FAILPOINTS, Failpoints
from daemon.runtime.logs import RecentLog, log_to_stdout
from daemon.runtime.loop_monitor import EventLoopMonitor
from daemon.runtime.memory_trim import MemoryTrim
from daemon.runtime.metrics import Metrics
from daemon.runtime.shared_reading import RecentReading
from daemon.runtime.systemd import Doing, ServiceEnds, StatusLine, Systemd, UpdateHold, read_ends
from daemon.runtime.workers import Workers
from daemon.scans.registration_jobs import RegistrationJobs
from daemon.scans.scan_service import ScanService
from daemon.server import Announce, Server, SettingsReload, make_announcer
from daemon.sessions.look import share_looks
from daemon.sessions.pictures import LivePictures
from daemon.store.access_keys import KeyService
from daemon.store.key_watch import KeyWatch
from daemon.store.monitor import KeyExpiry, StoreMonitor
from daemon.store.retention import Retention
from daemon.store.sign_in import SignIn
from daemon.store.store import Store
from daemon.webhooks.dispatcher import WebhookDispatcher
from extensions.installed import INSTALLED

OpenDevices = Callable[[Settings, Clock], Devices]


def build(
    settings: Settings,
    open_devices: OpenDevices,
    *,
    clock: Clock | None = None,
    new_id: Callable[[Clock], str] = time_ordered_id,
    store: Store | None = None,
    systemd: Systemd | None = None,
    at: Failpoints = NO_FAILPOINTS,
    settings_file: SettingsFile | None = None,
    extensions: Extensions = INSTALLED,
) -> Application:
    """Build the application inside a running event loop. Raises DaemonError, DeviceError, DocumentError."""
    clock, systemd = clock or Clock(), systemd or Systemd.from_environment(os.environ, os.getpid())
    store = store or Store(Path(settings.storage.folder), at=at)
    events, metrics = EventBus(store.stored_events), Metrics()
    store.publish = events.publish
    workers, service_workers, merge_workers = Workers(clock), Workers(clock), Workers(clock, threads=1, niceness=10)
    interlocks = settings.interlocks.open() if settings.interlocks else None
    devices = open_devices(settings, clock)
    exposure = open_exposure_control(settings, devices.camera, workers, clock)
    robot, valid_s = settings.robot, 60 * settings.robot.temperature_minutes
    arm = ArmInCell(robot.external_axis, robot.carried, valid_s, clock.monotonic_s, settings.reach_mm)
    cell = Cell(
        devices, robot.settling, clock, interlocks, at, events.publish, exposure, robot.world_T_base, arm
    )  # fmt: skip
    update_hold = UpdateHold(clock, systemd.hold_file)
    supervisor = Supervisor(cell, store, events, clock, new_id, lambda: update_hold.reason)
    scans = ScanService(
        store,
        service_workers,
        merge_workers,
        clock,
        new_id,
        settings.named_scanners(),
        RegistrationJobs(store, merge_workers, clock, events),
        events.publish,
        arm,
        lambda: supervisor.in_progress is not None,
    )
    rules = MotionRules(robot)
    sensors = next((extension.sensors for extension in extensions if extension.sensors), no_further_sensors)
    operations = Operations(
        settings, cell, store, supervisor, workers, scans, rules, clock, service_workers, merge_workers,
        further_sensors=sensors,
        identification=next((one.identification for one in extensions if one.identification), None),
    )  # fmt: skip
    by_name: dict[str, Operations] = {}

    def camera_of(name: str) -> CellCamera:
        view, seen_by = settings.of_camera(name), cell
        if name != MAIN_CAMERA:
            seen_by = cell.seen_by(name, open_exposure_control(view, devices.cameras[name], workers, clock))
        pictures = LivePictures(seen_by.camera_turns.read, service_workers, clock.monotonic_s)
        drift = DriftMonitor(view, store, events, service_workers, clock, arm, name)
        return CellCamera(
            name,
            view,
            replace(
                operations, settings=view, cell=seen_by, camera=name, others=by_name, learnt_noise=drift.robot_noise
            ),
            pictures,
            share_looks(pictures.frame.read, view.target, service_workers, clock),
            drift,
            RecentReading(seen_by.obstacles, clock.monotonic_s),
        )

    cameras = tuple(map(camera_of, settings.camera_names))
    by_name.update({camera.name: camera.operations for camera in cameras})
    operations, drifts = cameras[0].operations, [camera.drift for camera in cameras]
    webhooks = WebhookDispatcher(settings.webhooks, store.outbox, clock, random.random)
    loop_monitor, device_watch = EventLoopMonitor(), DeviceWatch(cell, clock, events.publish)
    key_watch = KeyWatch(store.access_keys, store.browser_sessions, clock)
    every_s = 3600 * settings.drift.every_h
    schedules = [DriftSchedule(camera.operations, clock, every_s) for camera in cameras]

    def doing() -> Doing:
        run = supervisor.in_progress
        words = "" if run is None else f"run {run.id} ({run.kind})"
        return Doing(words, update_hold.reason, application.warnings())

    application = Application(
        settings=settings,
        settings_file=settings_file,
        clock=clock,
        new_id=lambda: new_id(clock),
        cell=cell,
        readings=CellReadings(cell, clock),
        store=store,
        events=events,
        workers=workers,
        service_workers=service_workers,
        merge_workers=merge_workers,
        supervisor=supervisor,
        operations=operations,
        scans=scans,
        metrics=metrics,
        cameras=cameras,
        key_service=KeyService(store.access_keys, clock),
        sign_in=SignIn(store.access_keys, store.browser_sessions, clock, 60 * settings.server.idle_minutes),
        key_watch=key_watch,
        device_watch=device_watch,
        systemd=systemd,
        service_key=None if systemd.runtime_folder is None else ServiceKey.make(systemd.runtime_folder),
        loop_monitor=loop_monitor,
        recent_log=RecentLog(),
        services=(
            cell.safe_stop,
            update_hold,
            StoreMonitor(store, events),
            webhooks,
            Retention(store, service_workers, clock, settings.storage),
            LateAddresses(lambda: application.settings.listens_at),
            KeyExpiry(store.access_keys, clock),
            key_watch,
            ServiceEnds(read_ends(systemd.runtime_folder)),
            device_watch,
            loop_monitor,
            StatusLine(systemd, doing, clock),
            MemoryTrim(),
            *drifts,
            *schedules,
        ),
    )
    switched = {name: make(application) for extension in extensions for name, make in extension.sections.items()}
    application.sections = {"webhooks": webhooks, **switched}
    for name in OF_SERVICES:
        if getattr(settings, name):
            application.section(name)
    added = (make(application) for extension in extensions for make in extension.services)
    application.services += (*switched.values(), *added)
    if settings_file is not None:
        reload = SettingsReload(settings_file, application)
        application.reload, application.services = reload.reload, (*application.services, reload)
    return application


def serve(
    settings: Settings,
    *,
    ready_file: Path | None = None,
    settings_file: SettingsFile | None = None,
    setup_file: Path | None = None,
) -> bool:
    """Run the daemon until SIGTERM, SIGINT or one of ENDING_SIGNALS. `ready_file` gets {"url", "pid"} once it answers.

    `settings_file`: what the settings were loaded from, for GET /about. `setup_file`: what the first set-up writes;
    then True is returned.

    Raises StorageError, DeviceError, NotInstalled, PortTaken.
    """
    log_to_stdout(logging.getLevelNamesMapping()[settings.server.log_level.upper()])
    faulthandler.enable(sys.__stderr__ or sys.stderr)  # a fatal signal leaves its stack; so does the watchdog's SIGABRT
    return uvloop.run(
        _serve(settings, settings_file, setup_file, make_announcer(ready_file, settings.server.certificate))
    )


async def _serve(
    settings: Settings, settings_file: SettingsFile | None, setup_file: Path | None, announce: Announce
) -> bool:
    application = build(settings, open_devices, settings_file=settings_file)
    is_service = application.systemd.address is not None
    reload = application.reload if is_service else None
    server = Server(application, announce, reload=reload, extensions=INSTALLED)
    application.setup_file, application.end = setup_file, partial(setattr, server, "should_exit", True)
    server.prepare()
    await server.listen()
    return application.begins_anew
