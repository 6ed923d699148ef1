"""The last lines of the log in memory, for a support bundle where no journal keeps them."""

import logging
from collections import deque
from datetime import UTC, datetime

from daemon.runtime.logs import OneLineFormatter

MAX_LINES, MAX_LINE_LENGTH = 2000, 2000


class RecentLog(logging.Handler):
    """Keeps the last 2000 log lines of this process, each of at most 2000 characters, with their times."""

    def __init__(self) -> None:
        super().__init__()
        self.setFormatter(OneLineFormatter())
        self._lines: deque[str] = deque(maxlen=MAX_LINES)

    async def start(self) -> None:
        """Keep what is logged from now on."""
        logging.getLogger().addHandler(self)

    async def stop(self) -> None:
        logging.getLogger().removeHandler(self)

    def emit(self, record: logging.LogRecord) -> None:
        at = datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds")
        self._lines.append(f"{at} {self.format(record)}"[:MAX_LINE_LENGTH])

    def text(self) -> str:
        """The lines, oldest first."""
        return "\n".join(self._lines.copy())
