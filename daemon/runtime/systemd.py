"""sd_notify(3) over NOTIFY_SOCKET: READY, STATUS, STOPPING, WATCHDOG. Sends nothing without systemd."""

import asyncio
import logging
import socket
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from daemon.runtime.hang_report import HangReport
from daemon.runtime.logs import print_error_line

HOLD_FILE = Path("/run/handeyed.hold")
"""Only root can write there: deploy/handeyed-release does."""

HANG_SHARE = 0.8
"""Of the watchdog's period: then a hang is reported, before systemd ends the process."""

log = logging.getLogger(__name__)


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
