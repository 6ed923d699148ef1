"""sd_notify(3) over NOTIFY_SOCKET: READY, STATUS, STOPPING, WATCHDOG. Sends nothing without systemd.

Before the watchdog ends the daemon, the stacks of all threads and tasks say on standard error where it hangs.
"""

import asyncio
import io
import logging
import socket
import sys
import threading
import traceback
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from daemon.runtime.clock import Clock
from daemon.runtime.logs import print_error_line
from daemon.runtime.tasks import InBackground

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
        try:
            return sorted(asyncio.all_tasks(loop), key=lambda task: task.get_name())
        except RuntimeError:  # it was changed during the look
            continue
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
    def of(cls, environment: Mapping[str, str], pid: int) -> "Systemd":
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
        try:
            await self._feed(work_is_alive, report)
        finally:
            report.stop()

    async def _feed(self, work_is_alive: Callable[[], Awaitable[bool]], report: HangReport) -> None:
        assert self.watchdog_s is not None
        warned = False
        while True:
            alive = await _answers(work_is_alive, self.watchdog_s / 3)
            if alive:
                report.note()
                self.notify("WATCHDOG=1")
            elif not warned:
                log.error("the work hangs: the watchdog is not fed")
            warned = not alive
            await asyncio.sleep(self.watchdog_s / 3)


async def _answers(work_is_alive: Callable[[], Awaitable[bool]], limit_s: float) -> bool:
    try:
        async with asyncio.timeout(limit_s):
            return await work_is_alive()
    except TimeoutError:
        return False


PERIOD_S = 1.0
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
            await self._clock.sleep(PERIOD_S)
