"""sd_notify(3) over NOTIFY_SOCKET: READY, STATUS, STOPPING, WATCHDOG. Sends nothing without systemd.

Before the watchdog ends the daemon, the stacks of all threads and tasks say on standard error where it hangs. How often
systemd has started the service again, and why, stands in a file: ExecStopPost= writes each end. While root keeps
another one fresh, an update holds the cell: no run begins, and the update waits for the one in progress.
"""

import asyncio
import io
import logging
import socket
import sys
import threading
import traceback
from collections.abc import Awaitable, Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from calibration.sentences.sentence import Sentence
from daemon.runtime.bounded_read import read_bounded
from daemon.runtime.clock import Clock
from daemon.runtime.logs import print_error_line
from daemon.runtime.metrics import Labels, Metric
from daemon.runtime.tasks import InBackground, Service

HOLD_FILE = Path("/run/handeyed.hold")
"""Only root can write there: deploy/handeyed-release does."""

HANG_SHARE = 0.8
"""Of the watchdog's period: then a hang is reported, before systemd ends the process."""

MAX_LINES = 1000
"""Most lines of a report of a hang."""

log = logging.getLogger(__name__)


class HangReport:
    """A thread that writes one report when nobody calls `note` for `limit_s`, and the next after another `note`.

    A thread of its own, because the event loop may be what hangs. Where C code never gives Python's lock back it cannot
    write either: then faulthandler writes the threads when systemd's SIGABRT comes.
    """

    def __init__(self, limit_s: float, write: Callable[[str], None]) -> None:
        """`write` takes one line."""
        self._limit_s, self._write = limit_s, write
        self._noted, self._ending = threading.Event(), False
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Begin to watch the event loop that this is called in."""
        self._loop = asyncio.get_running_loop()
        self._thread = threading.Thread(target=self._watch, args=(self._loop,), name="hang report", daemon=True)
        self._thread.start()

    def note(self) -> None:
        """The work is alive."""
        self._noted.set()

    def stop(self) -> None:
        """End the thread."""
        self._ending = True
        self._noted.set()
        if self._thread is not None:
            self._thread.join()

    def _watch(self, loop: asyncio.AbstractEventLoop) -> None:
        reported = False
        while not self._ending:
            if self._noted.wait(self._limit_s):
                self._noted.clear()
                reported = False
            elif not reported:
                reported = True
                for line in stacks(loop, self._limit_s):
                    self._write(line)


def stacks(loop: asyncio.AbstractEventLoop, hung_s: float) -> list[str]:
    """Lines: the stack of each thread and of each task of the loop, MAX_LINES at the most."""
    names = {thread.ident: thread.name for thread in threading.enumerate()}
    lines = [f"nothing has gone on for {hung_s:.0f} s; where each thread and task stands:"]
    for ident, frame in sys._current_frames().items():
        if ident != threading.get_ident():
            lines.append(f"thread {names.get(ident, ident)}:")
            lines += _split("".join(traceback.format_stack(frame)))
    for task in _tasks_of(loop):
        text = io.StringIO()
        task.print_stack(file=text)
        lines.append(f"task {task.get_name()}:")
        lines += _split(text.getvalue())
    return lines[:MAX_LINES]


def _split(text: str) -> Iterator[str]:
    return (line.rstrip() for line in text.splitlines() if line.strip())


def _tasks_of(loop: asyncio.AbstractEventLoop) -> "list[asyncio.Task[object]]":
    """The tasks that are not done; none where the loop goes on and changes them all the time."""
    for _ in range(10):
        with suppress(RuntimeError):  # it was changed during the look
            return sorted(asyncio.all_tasks(loop), key=lambda task: task.get_name())
    return []


@dataclass(frozen=True)
class Systemd:
    """`address` of the notify socket and the watchdog period `watchdog_s`; None when systemd did not set them.

    `hold_file`: with which an update holds the service. `runtime_folder`: RuntimeDirectory=, which only the service and
    its group can read. Both None for a daemon that is no service.
    """

    address: str | None
    watchdog_s: float | None
    hold_file: Path | None = None
    runtime_folder: Path | None = None

    @classmethod
    def from_environment(cls, environment: Mapping[str, str], pid: int) -> "Systemd":
        address = environment.get("NOTIFY_SOCKET") or None
        microseconds = environment.get("WATCHDOG_USEC", "")
        ours = environment.get("WATCHDOG_PID", str(pid)) == str(pid)
        watchdog = int(microseconds) / 1e6 if ours and microseconds.isdigit() and int(microseconds) else None
        runtime = environment.get("RUNTIME_DIRECTORY", "").partition(":")[0]
        if address is None:
            return cls(None, watchdog)
        return cls(address, watchdog, HOLD_FILE, Path(runtime) if runtime else None)

    def notify(self, state: str) -> None:
        """Send one state; a failure is logged, not raised."""
        if self.address is None:
            return
        address = "\0" + self.address[1:] if self.address.startswith("@") else self.address
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
                sender.setblocking(False)
                sender.sendto(state.encode(), address)
        except OSError as error:
            log.warning("systemd could not be notified of %s: %s", state.split("=")[0], error)

    async def feed_watchdog(self, work_is_alive: Callable[[], Awaitable[bool]]) -> None:
        """Send WATCHDOG=1 every third of the period while `work_is_alive` answers True, until cancelled.

        When it hangs or answers False nothing is sent, and systemd restarts the daemon; before it does, the stacks of
        all threads and tasks are written to standard error.
        """
        if self.watchdog_s is None:
            return
        report = HangReport(HANG_SHARE * self.watchdog_s, print_error_line)
        report.start()
        warned = False
        try:
            while True:
                alive = await _answers(work_is_alive, self.watchdog_s / 3)
                if alive:
                    report.note()
                    self.notify("WATCHDOG=1")
                elif not warned:
                    log.error("the work hangs: the watchdog is not fed")
                warned = not alive
                await asyncio.sleep(self.watchdog_s / 3)
        finally:
            report.stop()


async def _answers(work_is_alive: Callable[[], Awaitable[bool]], limit_s: float) -> bool:
    try:
        async with asyncio.timeout(limit_s):
            return await work_is_alive()
    except TimeoutError:
        return False


STATUS_PERIOD_S = 1.0
"""Of the line that `systemctl status` shows."""


@dataclass(frozen=True)
class Doing:
    """`run`: the one in progress in words, "" when there is none; `update`: the one that holds the cell, or None."""

    run: str
    update: str | None
    warnings: Sequence[str]

    def line(self) -> str:
        """One line. `handeyed-release` reads how it begins: "held, free" lets the update go on."""
        if self.update is not None:
            return f"held, {self.run} is in progress: {self.update} waits for its end" if self.run else (
                f"held, free for {self.update}"
            )  # fmt: skip
        more = f" (and {len(self.warnings) - 1} more warnings: /ready)" if len(self.warnings) > 1 else ""
        warning = f"; {self.warnings[0]}{more}" if self.warnings else ""
        return f"{self.run} is in progress{warning}" if self.run else f"up, no run in progress{warning}"


class StatusLine(InBackground):
    """Background service: gives systemd the line whenever it changes."""

    def __init__(self, systemd: Systemd, doing: Callable[[], Doing], clock: Clock) -> None:
        self._systemd, self._doing, self._clock = systemd, doing, clock
        self._latest = ""

    def send(self) -> None:
        """Send the line if it is another than the last."""
        line = self._doing().line()
        if line != self._latest:
            self._latest = line
            self._systemd.notify(f"STATUS={line}")

    async def run(self) -> None:
        while self._systemd.address is not None:
            self.send()
            await self._clock.sleep(STATUS_PERIOD_S)


ENDS = "ends"
"""In the runtime folder, which systemd keeps until the next start after a failure, and deletes when it is stopped."""

RECENT_S = 24 * 3600.0
"""An end is warned of for so long."""


@dataclass(frozen=True)
class ServiceEnd:
    """One end that nobody asked for: when, in seconds since 1970, and its cause in systemd's words."""

    at_s: float
    cause: str


def read_ends(folder: Path | None) -> tuple[ServiceEnd, ...]:
    """Ends that nobody asked for, oldest first; empty for a daemon that is no service."""
    if folder is None:
        return ()
    try:
        lines = read_bounded(folder / ENDS).decode("ascii", "replace").splitlines()
    except OSError:
        return ()
    ends = (_parse(line) for line in lines)
    return tuple(end for end in ends if end is not None)


def _parse(line: str) -> ServiceEnd | None:
    """An end of "1795680000 watchdog killed ABRT"; None for one that was asked for."""
    at, result, code, status, *_ = [*line.split(), "", "", "", ""]
    if not at.isdigit() or result in ("", "success"):
        return None
    detail = {"exit-code": f"exit status {status}", "signal": f"signal {status}", "core-dump": f"signal {status}"}
    return ServiceEnd(float(at), detail.get(result, result) if code else result)


@dataclass(frozen=True)
class ServiceEnds(Service):
    """What /ready and /metrics say of the ends. `now_s`: seconds since 1970."""

    ends: tuple[ServiceEnd, ...]
    now_s: Callable[[], float] = lambda: datetime.now(UTC).timestamp()

    def warnings(self) -> list[str]:
        """The last end, while it is recent."""
        if not self.ends or self.now_s() - self.ends[-1].at_s > RECENT_S:
            return []
        last = self.ends[-1]
        at = datetime.fromtimestamp(last.at_s, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
        return [Sentence("service-restarted", count=len(self.ends), cause=last.cause, at=at)]

    def families(self) -> Iterable[Metric]:
        """The number of ends by cause."""
        causes = [end.cause for end in self.ends]
        samples: dict[Labels, float] = {
            (("cause", cause),): float(causes.count(cause)) for cause in sorted(set(causes))
        }
        about = "Starts of the service after ends that nobody asked for, since somebody started it, by cause."
        return [Metric("handeyed_service_restarts_total", "counter", about, samples or {(("cause", "none"),): 0.0})]


HOLD_PERIOD_S = 0.5

MAX_SILENT_S = 60.0
"""A hold that nobody touched for so long is over: who made it has died."""

MAX_REASON = 100


class UpdateHold(InBackground):
    """Background service: `reason` is the file's text while it is kept fresh, else None.

    `handeyed-release` (deploy/) writes the file and touches it every second; one that is left behind lapses. A file
    needs neither key nor certificate, and only root can write below /run.
    """

    def __init__(self, clock: Clock, file: Path | None) -> None:
        """`file` None: nothing ever holds."""
        self._clock, self._file = clock, file
        self._touched_ns: int | None = None
        self._touched_at_s = 0.0
        self.reason: str | None = None

    async def start(self) -> None:
        self.look()
        await super().start()

    def look(self) -> None:
        """Read the file once. Its age is counted from the last touch that was seen: clocks of the day may jump."""
        if self._file is None:
            return
        try:
            touched_ns = self._file.stat().st_mtime_ns
            with self._file.open(encoding="utf-8", errors="replace") as text:
                reason = "".join(filter(str.isprintable, text.readline(MAX_REASON)))
        except OSError:
            self.reason = self._touched_ns = None
            return
        if touched_ns != self._touched_ns:
            self._touched_ns, self._touched_at_s = touched_ns, self._clock.monotonic_s()
        fresh = self._clock.monotonic_s() - self._touched_at_s <= MAX_SILENT_S
        self.reason = (reason or "an update") if fresh else None

    def warnings(self) -> list[str]:
        """The reason of the hold, for GET /ready."""
        return [] if self.reason is None else [Sentence("update-holds", update=self.reason)]

    async def run(self) -> None:
        while True:
            await self._clock.sleep(HOLD_PERIOD_S)
            self.look()
