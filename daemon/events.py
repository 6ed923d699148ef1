"""What happened, numbered, for anyone who listens. The last ones are kept, so that a listener can catch up."""

import asyncio
from collections import deque
from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import Any

KEPT = 1000


@dataclass(frozen=True)
class Event:
    """`number` counts up from 1 since the daemon started; `kind` names what `data` holds."""

    number: int
    kind: str
    data: dict[str, Any]


class EventLog:
    """Publishers never wait; a listener that is too slow loses the oldest and sees it by the numbers."""

    def __init__(self) -> None:
        self._kept: deque[Event] = deque(maxlen=KEPT)
        self._last = 0
        self._news = asyncio.Event()
        self.closed = False

    def publish(self, kind: str, data: dict[str, Any]) -> None:
        self._last += 1
        self._kept.append(Event(self._last, kind, data))
        self._ring()

    def close(self) -> None:
        """Ends every listener."""
        self.closed = True
        self._ring()

    @property
    def last(self) -> int:
        return self._last

    async def listen(self, after: int) -> AsyncIterator[Event]:
        """Every event numbered above `after`, as they come, until the log is closed."""
        while True:
            news = self._news
            for event in [event for event in self._kept if event.number > after]:
                after = event.number
                yield event
            if self.closed:
                return
            if after >= self._last:
                await news.wait()

    def _ring(self) -> None:
        news, self._news = self._news, asyncio.Event()
        news.set()
