"""The line that `systemctl status` shows: what the daemon does, what holds it, or its first warning."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from daemon.runtime.clock import Clock
from daemon.runtime.systemd import Systemd
from daemon.runtime.tasks import InBackground

PERIOD_S = 1.0


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
