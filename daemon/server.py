"""The daemon's process: uvicorn, signals, the announcement of its URL, and changed settings that it takes over.

`systemctl reload handeyed`, SIGHUP to a service: what APPLIED names is taken over at once, [calibration], [part],
[report] and the camera's exposure after the run in progress. Of all else the daemon says that it needs a restart.
"""

import asyncio
import gc
import json
import logging
import os
import signal
import socket
import ssl
import sys
import threading
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any

import uvicorn

from calibration.errors import DocumentError
from calibration.sentences.sentence import Sentence
from daemon.access.tls_context import server_context
from daemon.api.app import create_api, routes
from daemon.api.extension import Extensions
from daemon.application import Application
from daemon.cell.devices import open_exposure_control
from daemon.config.settings import OF_SERVICES, Settings, SettingsFile, load_settings_file
from daemon.errors import DaemonError
from daemon.http.connection_limiter import ConnectionLimiter
from daemon.http.connections import limited_connection
from daemon.http.listen_socket import open_listener
from daemon.http.listener import HttpListener, PendingConnection
from daemon.runtime.durable_files import write_durably
from daemon.runtime.tasks import Service

log = logging.getLogger(__name__)

GRACE_S = 4
"""How long answers in progress may take after SIGTERM; event streams end at once."""

KEEP_ALIVE_S = 10
"""An idle connection is closed after this."""

ENDING_SIGNALS = (signal.SIGHUP, signal.SIGQUIT, signal.SIGUSR1, signal.SIGUSR2, signal.SIGALRM)
"""Signals that end a process unless it handles them; uvicorn handles SIGTERM and SIGINT only."""

COLLECT_AFTER = (700, 10, 50)
"""Thresholds of the garbage collector. A collection of everything takes 60 ms when a thousand clients are connected, so
there are few; requests and connections leave nothing for it.
"""

SWITCH_S = 0.0005
"""How long the event loop waits for Python in another thread; Python's 5 ms would add up over the turns of an abort."""

Announce = Callable[[str], None]
"""Called with the URL once requests are answered."""

APPLIED = ("calibration", "part", "report", "server.log_level", "camera.exposure", *OF_SERVICES)
"""Sections and keys that are taken over while the daemon runs."""

RELOAD_POLL_S = 0.5
"""Interval of looking whether a run is still in progress, of which settings are not changed."""

Reload = Callable[[], Coroutine[Any, Any, None]]
"""Takes the changed settings file over."""


def changes(before: Settings, after: Settings) -> list[str]:
    """The sections that differ, and of those that hold keys the keys: "plc", "robot.speed_mm_s"."""
    ours, theirs = before.model_dump(mode="json"), after.model_dump(mode="json")
    names = []
    for section in ours:
        one, other = ours[section], theirs[section]
        if one == other:
            continue
        if isinstance(one, dict) and isinstance(other, dict) and section not in APPLIED:
            names += [f"{section}.{key}" for key in sorted({*one, *other}) if one.get(key) != other.get(key)]
        else:
            names.append(section)
    return names


def taken_over(before: Settings, after: Settings, names: list[str]) -> Settings:
    """`before` with what `names` lists of `after`."""
    update: dict[str, Any] = {name: getattr(after, name) for name in names if "." not in name}
    for section, _, key in (name.partition(".") for name in names if "." in name):
        update[section] = getattr(before, section).model_copy(update={key: getattr(getattr(after, section), key)})
    return before.model_copy(update=update)


@dataclass(eq=False)
class SettingsReload(Service):
    """Reloads the file of `loaded` into the application. `waits_for_restart`: what was changed and is not active."""

    loaded: SettingsFile
    application: Application
    waits_for_restart: tuple[str, ...] = field(default=(), init=False)

    def warnings(self) -> list[str]:
        """What of the file needs a restart, for GET /ready."""
        if not self.waits_for_restart:
            return []
        return [Sentence("settings-need-restart", names=", ".join(self.waits_for_restart))]

    async def reload(self) -> None:
        """Read the file, and take over what can be. What cannot be read or done is logged, and the old goes on."""
        systemd = self.application.systemd
        systemd.notify("RELOADING=1")
        try:
            after, file = load_settings_file(Path(self.loaded.file))
            await self._apply(after, file)
        except DocumentError as error:
            for problem in str(error).splitlines():
                log.error("the settings are as before: %s", problem)
        finally:
            systemd.notify("READY=1")

    async def _apply(self, after: Settings, file: SettingsFile) -> None:
        app = self.application
        names = changes(app.settings, after)
        done = [name for name in names if name in APPLIED]
        for name in [name for name in names if name in OF_SERVICES]:
            try:
                await app.section(name).change(getattr(after, name))
            except DaemonError as error:
                log.error("[%s] is as before: %s", name, error)
                done.remove(name)
        while app.supervisor.in_progress is not None and {"calibration", "part", "report", "camera.exposure"} & {*done}:
            await app.clock.sleep(RELOAD_POLL_S)
        app.settings = taken_over(app.settings, after, done)
        logging.getLogger().setLevel(app.settings.server.log_level.upper())
        for camera in app.cameras:
            camera.settings = camera.operations.settings = app.settings.of_camera(camera.name)
            cell = camera.operations.cell
            cell.exposure = open_exposure_control(camera.settings, cell.camera, app.workers, app.clock)
        self.waits_for_restart = tuple(name for name in names if name not in done)
        if not self.waits_for_restart:
            app.settings_file = self.loaded = file
        log.info("settings taken over: %s", ", ".join(done) or "nothing has changed that could be")
        if self.waits_for_restart:
            log.warning("these settings need a restart: %s", ", ".join(self.waits_for_restart))


class Server(uvicorn.Server):
    """uvicorn's server; stops the run as soon as a signal arrives, and announces its URL."""

    def __init__(
        self,
        application: Application,
        announce: Announce,
        limiter: ConnectionLimiter | None = None,
        reload: Reload | None = None,
        *,
        extensions: Extensions,
    ) -> None:
        """`reload`: what SIGHUP does to a service; without it the signal ends the process."""
        self._reload = reload
        self._reload_task: asyncio.Task[None] | None = None
        self._limiter = limiter or ConnectionLimiter()
        self._routes = routes(application, extensions)
        super().__init__(
            uvicorn.Config(
                create_api(self._routes, application),
                http=partial(limited_connection, self._limiter),  # type: ignore[arg-type] # called, never subclassed
                ws="none",
                proxy_headers=False,  # anybody on this machine could give themselves another address
                timeout_graceful_shutdown=GRACE_S,
                timeout_keep_alive=KEEP_ALIVE_S,
                log_config=None,
                access_log=False,
                server_header=False,
                lifespan="on",
            )
        )
        self._application, self._announce = application, announce
        self._loop: asyncio.AbstractEventLoop | None = None
        self._listener: socket.socket | None = None
        self._tls: ssl.SSLContext | None = None

    def prepare(self) -> None:
        """Do before the first request what would keep the event loop then: garbage collection."""
        sys.setswitchinterval(SWITCH_S)
        gc.collect()
        gc.freeze()  # what lives as long as the process is not looked through again
        gc.set_threshold(*COLLECT_AFTER)

    async def listen(self) -> None:
        """Serve until a signal comes or `should_exit` is set. Raises DaemonError."""
        settings = self._application.settings.server
        if settings.certificate is not None and settings.private_key is not None:
            self._tls = server_context(settings.certificate, settings.private_key)
        with open_listener(settings.host, settings.port) as self._listener:
            await self.serve([self._listener])

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start the application, then like uvicorn's, and announce the URL. Raises DaemonError.

        Not in the lifespan: there an error is a traceback in the log, and the process ends without a word.
        """
        self._loop = asyncio.get_running_loop()
        await self._application.start()
        await super().startup([])
        if self._listener is not None:
            limits = self._limiter.limits
            accepts = HttpListener(self._listener, self._tls, limits.head_s, self._limiter, self._protocol)
            self.servers.append(accepts)  # type: ignore[arg-type] # it is closed, and waited for
        if self.started:
            self._application.systemd.notify("READY=1")
            self._announce(self.url())

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Like uvicorn's, then wait for the requests that it cancelled: their threads and files end with them."""
        await super().shutdown(sockets)
        if not self.force_exit and (cancelled := list(self.server_state.tasks)):
            await asyncio.wait(cancelled, timeout=GRACE_S)

    def _protocol(self, pending: PendingConnection) -> asyncio.BaseProtocol:
        return limited_connection(
            self._limiter, pending, config=self.config, server_state=self.server_state, app_state=self.lifespan.state
        )

    def url(self) -> str:
        """The URL it listens on, also when port 0 was asked for."""
        assert self._listener is not None
        host, port = self._listener.getsockname()[:2]
        scheme = "http" if self._tls is None else "https"
        return f"{scheme}://[{host}]:{port}" if ":" in host else f"{scheme}://{host}:{port}"

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """As uvicorn's, for ENDING_SIGNALS too; a handled signal is not raised again: the process ends with status 0.

        A signal that the process was started to ignore, as by nohup, stays ignored.
        """
        before: dict[int, Any] = {}
        if threading.current_thread() is threading.main_thread():
            handled = [each for each in ENDING_SIGNALS if signal.getsignal(each) is not signal.SIG_IGN]
            before = {each: signal.signal(each, self.handle_exit) for each in handled}
            if self._reload is not None:
                before.setdefault(signal.SIGHUP, signal.getsignal(signal.SIGHUP))
                signal.signal(signal.SIGHUP, self._handle_reload)
        try:
            with super().capture_signals():
                yield
                self._captured_signals.clear()
        finally:
            for each, handler in before.items():
                signal.signal(each, handler)

    def _handle_reload(self, sig: int, frame: FrameType | None) -> None:
        if self._loop is not None:
            self._loop.call_soon_threadsafe(self._begin_reload)

    def _begin_reload(self) -> None:
        if self._reload is not None and self._reload_task is None:
            self._reload_task = asyncio.create_task(self._reload(), name="reload")
            self._reload_task.add_done_callback(self._end_reload)

    def _end_reload(self, done: "asyncio.Task[None]") -> None:
        self._reload_task = None
        if not done.cancelled() and (error := done.exception()) is not None:
            log.error("a defect ended the reload", exc_info=error)

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """On a signal stop the arm first, then everything else."""
        if self._loop is not None:
            name, self._application.begins_anew = signal.Signals(sig).name, False
            self._loop.call_soon_threadsafe(self._application.begin_stop, f"the daemon, which is stopping ({name})")
        super().handle_exit(sig, frame)


def make_announcer(ready_file: Path | None, certificate: str | None = None) -> Announce:
    """A function that prints the URL, and atomically writes {"url", "pid", "certificate"} to `ready_file`.

    `certificate`: the file that clients on this machine may trust; left out without TLS.
    """

    def announce(url: str) -> None:
        print(f"handeyed listens on {url}", flush=True)  # noqa: T201 - the one line a person waits for
        if ready_file is not None:
            shown = {} if certificate is None else {"certificate": certificate}
            write_durably(ready_file, [json.dumps({"url": url, "pid": os.getpid(), **shown}).encode()])
            ready_file.chmod(0o644)  # whoever is here may know that the cell is held, and where

    return announce
