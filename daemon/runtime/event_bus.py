"""What happened, numbered, for anyone who listens. The last ones are kept, so that a listener can catch up."""

import asyncio
import logging
from collections import deque
from collections.abc import AsyncIterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from daemon.errors import StorageError

log = logging.getLogger(__name__)

KEPT = 1000

SKIPPED = 1000
"""Numbers left out after a restart: those told before a crash but not kept must not come twice."""


@dataclass(frozen=True)
class Event:
    """`number` counts up and is never used twice; `kind` names what `data` holds."""

    number: int
    kind: str
    data: dict[str, Any]


class Keeper(Protocol):
    """Where events survive a restart."""

    async def last(self) -> list[Event]: ...

    async def keep(self, events: Sequence[Event]) -> None: ...


class EventLog:
    """Publishers never wait. An event is told once it is kept; one that the disk refuses is told all the same.

    A listener that is too slow loses the oldest, and is told so by an event of kind "lost".
    """

    def __init__(self, keeper: Keeper | None = None) -> None:
        self._keeper = keeper
        self._kept: deque[Event] = deque(maxlen=KEPT)
        self._waiting: list[Event] = []
        self._writer: asyncio.Task[None] | None = None
        self._numbered = 0
        self._told = 0
        self._forgotten = 0
        self._news = asyncio.Event()
        self.closed = False

    async def recover(self) -> None:
        """Go on where an earlier daemon ended. Raises StorageError."""
        if self._keeper is not None and (kept := await self._keeper.last()):
            self._kept.extend(kept)
            self._forgotten = kept[0].number - 1
            self._told, self._numbered = kept[-1].number, kept[-1].number + SKIPPED

    def publish(self, kind: str, data: dict[str, Any]) -> None:
        self._numbered += 1
        event = Event(self._numbered, kind, data)
        if self._keeper is None:
            self._tell([event])
            return
        self._waiting.append(event)
        if self._writer is None:
            self._writer = asyncio.create_task(self._write(self._keeper))

    def close(self) -> None:
        """Ends every listener, once it has heard what was published."""
        self.closed = True
        self._ring()

    async def written(self) -> None:
        """Returns when everything published is kept."""
        while self._writer is not None:
            await asyncio.wait([self._writer])

    @property
    def last(self) -> int:
        """The number of the last event told."""
        return self._told

    async def listen(self, after: int, quiet_s: float | None = None) -> AsyncIterator[Event | None]:
        """Every event numbered above `after`, as they come, until the log is closed; None after each `quiet_s`."""
        if 0 < after < self._forgotten:
            yield Event(self._forgotten, "lost", {"after": after, "until": self._forgotten})
        while True:
            news = self._news
            for event in [event for event in self._kept if event.number > after]:
                after = event.number
                yield event
            if self.closed and self._writer is None:
                return
            if after < self._told:
                continue
            try:
                await asyncio.wait_for(news.wait(), quiet_s)
            except TimeoutError:
                yield None

    async def _write(self, keeper: Keeper) -> None:
        """Keeps what waits, as much at a time as there is."""
        while self._waiting:
            events, self._waiting = self._waiting, []
            try:
                await keeper.keep(events)
            except StorageError as error:
                log.warning("events could not be kept: %s", error)
            self._tell(events)
        self._writer = None
        self._ring()

    def _tell(self, events: Sequence[Event]) -> None:
        for event in events:
            if len(self._kept) == KEPT:
                self._forgotten = self._kept[0].number
            self._kept.append(event)
        self._told = events[-1].number
        self._ring()

    def _ring(self) -> None:
        news, self._news = self._news, asyncio.Event()
        news.set()
