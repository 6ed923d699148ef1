"""One reading for all who ask at the same time."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Generic, TypeVar

Answer = TypeVar("Answer")


class SharedReading(Generic[Answer]):
    """Shares the readings of `source` among callers; each gets one that was begun after its call.

    At most one is in progress and one waits for it, however many ask. A caller that is cancelled ends no reading.
    """

    def __init__(self, source: Callable[[], Awaitable[Answer]]) -> None:
        self._source = source
        self._current: asyncio.Task[Answer] | None = None
        self._next: asyncio.Task[Answer] | None = None

    async def read(self) -> Answer:
        """A fresh reading. Raises what the source raises."""
        if self._next is None:
            self._next = asyncio.create_task(self._read_after(self._current))
        return await asyncio.shield(self._next)

    async def _read_after(self, before: "asyncio.Task[Answer] | None") -> Answer:
        if before is not None:
            await asyncio.wait([before])
        self._current, self._next = self._next, None
        return await self._source()
