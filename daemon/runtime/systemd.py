"""sd_notify(3) over NOTIFY_SOCKET: READY, STOPPING, WATCHDOG. Without systemd nothing is sent."""

import asyncio
import logging
import socket
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Systemd:
    """`address` of the notify socket, and how often the watchdog wants to be fed; None where systemd asks nothing."""

    address: str | None
    watchdog_s: float | None

    @classmethod
    def of(cls, environment: Mapping[str, str], pid: int) -> "Systemd":
        address = environment.get("NOTIFY_SOCKET") or None
        microseconds = environment.get("WATCHDOG_USEC", "")
        ours = environment.get("WATCHDOG_PID", str(pid)) == str(pid)
        watchdog = int(microseconds) / 1e6 if ours and microseconds.isdigit() and int(microseconds) else None
        return cls(address, watchdog)

    def notify(self, state: str) -> None:
        """Send one state; a service manager that does not listen is no reason to stop."""
        if self.address is None:
            return
        address = "\0" + self.address[1:] if self.address.startswith("@") else self.address
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
                sender.setblocking(False)
                sender.sendto(state.encode(), address)
        except OSError as error:
            log.warning("systemd could not be told %s: %s", state.split("=")[0], error)

    async def feed_watchdog(self, work_is_alive: Callable[[], Awaitable[bool]]) -> None:
        """Feeds while the work answers, until cancelled. A check that hangs or says no leaves systemd to restart us."""
        if self.watchdog_s is None:
            return
        hungry = False
        while True:
            alive = await _answers(work_is_alive, self.watchdog_s / 3)
            if alive:
                self.notify("WATCHDOG=1")
            elif not hungry:
                log.error("the work hangs: the watchdog is not fed")
            hungry = not alive
            await asyncio.sleep(self.watchdog_s / 3)


async def _answers(work_is_alive: Callable[[], Awaitable[bool]], limit_s: float) -> bool:
    try:
        async with asyncio.timeout(limit_s):
            return await work_is_alive()
    except TimeoutError:
        return False
