"""One reading of a device for all who ask within a short time."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Generic, TypeVar

Answer = TypeVar("Answer")

MAX_AGE_S = 0.1
"""Age up to which a reading is given again, counted from its end: readers cost a device ten readings a second."""


class RecentReading(Generic[Answer]):
    """A reading of `source` that is in progress, or ended at most `max_age_s` ago, else a new one.

    A reading goes on when all who wait have left, and is given to the next: one that is asked for and given up again
    and again would reach the device each time. Errors are given to those who wait, and not again.
    """

    def __init__(
        self, source: Callable[[], Awaitable[Answer]], monotonic_s: Callable[[], float], max_age_s: float = MAX_AGE_S
    ) -> None:
        self._source, self._monotonic_s, self._max_age_s = source, monotonic_s, max_age_s
        self._reading: asyncio.Task[Answer] | None = None
        self._ended_s = 0.0

    async def read(self) -> Answer:
        """The reading. Raises what the source raises."""
        if self._reading is None or self._is_old(self._reading):
            self._reading = asyncio.create_task(self._read())
            self._reading.add_done_callback(_retrieve)
        return await asyncio.shield(self._reading)

    async def _read(self) -> Answer:
        answer = await self._source()
        self._ended_s = self._monotonic_s()
        return answer

    def _is_old(self, reading: "asyncio.Task[Answer]") -> bool:
        if not reading.done():
            return False
        failed = reading.cancelled() or reading.exception() is not None
        return failed or self._monotonic_s() - self._ended_s > self._max_age_s


def _retrieve(reading: "asyncio.Task[Answer]") -> None:
    """Retrieve an error that nobody waits for any more, so that asyncio does not log it."""
    if not reading.cancelled():
        reading.exception()
