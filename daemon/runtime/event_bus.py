"""Publishes numbered events to any number of listeners, and keeps the last 1000 so that a listener can catch up."""

import asyncio
import logging
from collections import deque
from collections.abc import AsyncIterator, Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from daemon.errors import StorageError

log = logging.getLogger(__name__)

MAX_EVENTS = 1000

Publish = Callable[[str, dict[str, Any]], None]
"""Publishes an event of a kind with its data."""

RESTART_GAP = 1000
"""Numbers skipped after a restart, so that events sent but not stored before a crash are not numbered twice."""


@dataclass(frozen=True)
class BusEvent:
    """One event. `number` increases and is never reused; `kind` determines the keys of `data`."""

    number: int
    kind: str
    data: dict[str, Any]


class EventStore(Protocol):
    """Storage from which events are recovered after a restart."""

    async def last(self) -> list[BusEvent]: ...

    async def keep(self, events: Sequence[BusEvent]) -> None: ...


class EventBus:
    """Publish and subscribe. `publish` never waits: an event is stored, then delivered, also when storing failed.

    A listener more than MAX_EVENTS behind misses the oldest and receives one event of kind "lost" instead.
    """

    def __init__(self, keeper: EventStore | None = None) -> None:
        self._keeper = keeper
        self._kept: deque[BusEvent] = deque(maxlen=MAX_EVENTS)
        self._waiting: list[BusEvent] = []
        self._writer: asyncio.Task[None] | None = None
        self._numbered = 0
        self._last_number = 0
        self._forgotten = 0
        self._news = asyncio.Event()
        self.closed = False
        self.ended = asyncio.Event()

    async def recover(self) -> None:
        """Continue the numbering and history of the previous process. Raises StorageError."""
        if self._keeper is not None and (kept := await self._keeper.last()):
            self._kept.extend(kept)
            self._forgotten = kept[0].number - 1
            self._last_number, self._numbered = kept[-1].number, kept[-1].number + RESTART_GAP

    def publish(self, kind: str, data: dict[str, Any]) -> None:
        """Queue an event for storage and delivery; returns at once."""
        self._numbered += 1
        event = BusEvent(self._numbered, kind, data)
        if self._keeper is None:
            self._deliver([event])
            return
        self._waiting.append(event)
        if self._writer is None:
            self._writer = asyncio.create_task(self._write(self._keeper))

    def close(self) -> None:
        """End every listener after it has received what was published."""
        self.closed = True
        self.ended.set()
        self._wake_listeners()

    async def flush(self) -> None:
        """Wait until every published event is stored and delivered."""
        while self._writer is not None:
            await asyncio.wait([self._writer])

    @property
    def last(self) -> int:
        """The number of the last event delivered."""
        return self._last_number

    async def listen(self, after: int, idle_s: float | None = None) -> AsyncIterator[BusEvent | None]:
        """Yield events numbered above `after` until the bus is closed, and None after each `idle_s` without one."""
        if 0 < after < self._forgotten:
            yield BusEvent(self._forgotten, "lost", {"after": after, "until": self._forgotten})
        while True:
            news = self._news
            for event in [event for event in self._kept if event.number > after]:
                after = event.number
                yield event
            if self.closed and self._writer is None:
                return
            if after < self._last_number:
                continue
            try:
                await asyncio.wait_for(news.wait(), idle_s)
            except TimeoutError:
                yield None

    async def _write(self, keeper: EventStore) -> None:
        """Store and deliver the queued events in batches until the queue is empty."""
        while self._waiting:
            events, self._waiting = self._waiting, []
            try:
                await keeper.keep(events)
            except StorageError as error:
                log.warning("events could not be kept: %s", error)
            self._deliver(events)
        self._writer = None
        self._wake_listeners()

    def _deliver(self, events: Sequence[BusEvent]) -> None:
        for event in events:
            if len(self._kept) == MAX_EVENTS:
                self._forgotten = self._kept[0].number
            self._kept.append(event)
        self._last_number = events[-1].number
        self._wake_listeners()

    def _wake_listeners(self) -> None:
        news, self._news = self._news, asyncio.Event()
        news.set()
