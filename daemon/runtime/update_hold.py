"""The hold of an update: while root keeps a file fresh, no run begins, and the update waits for the one in progress.

`handeyed-release` (deploy/) writes the file and touches it every second; one that is left behind lapses. A file needs
neither key nor certificate, and only root can write below /run.
"""

from pathlib import Path

from calibration.sentences.sentence import Sentence
from daemon.runtime.clock import Clock
from daemon.runtime.tasks import InBackground

PERIOD_S = 0.5

MAX_SILENT_S = 60.0
"""A hold that nobody touched for so long is over: who made it has died."""

MAX_REASON = 100


class UpdateHold(InBackground):
    """Background service: `reason` is the file's text while it is kept fresh, else None."""

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
            await self._clock.sleep(PERIOD_S)
            self.look()
