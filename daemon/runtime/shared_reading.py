"""One reading for all who ask at the same time, or within a short time."""

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable
from functools import partial
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


MAX_AGE_S = 0.1
"""Age up to which a reading is given again, counted from its end: readers cost a device ten readings a second."""

MAX_RESUMED_A_TURN = 4
"""Of those who wait for a reading: a thousand that go on in one turn of the event loop would make it a second long."""


class RecentReading(Generic[Answer]):
    """A reading of `source` that is in progress, or ended at most `max_age_s` ago, else a new one.

    Those who waited for it go on a few in each turn of the event loop, in the order in which they asked.
    A reading goes on when all who wait have left, and is given to the next: one that is asked for and given up again
    and again would reach the device each time. Errors are given to those who wait, and not again.
    """

    def __init__(
        self, source: Callable[[], Awaitable[Answer]], monotonic_s: Callable[[], float], max_age_s: float = MAX_AGE_S
    ) -> None:
        self._source, self._monotonic_s, self._max_age_s = source, monotonic_s, max_age_s
        self._reading: asyncio.Task[Answer] | None = None
        self._waiting: deque[asyncio.Future[None]] = deque()
        self._ended_s = 0.0

    async def read(self) -> Answer:
        """The reading. Raises what the source raises."""
        if self._reading is None or self._is_old(self._reading):
            self._reading = asyncio.create_task(self._read())
            self._waiting = deque()
            self._reading.add_done_callback(partial(self._resume, self._waiting))
        reading = self._reading
        if not reading.done():
            waiting: asyncio.Future[None] = asyncio.get_running_loop().create_future()
            self._waiting.append(waiting)
            await waiting
        if not reading.cancelled() and (error := reading.exception()) is not None:
            raise error.with_traceback(None)  # else it would grow with each who waited, and keep what they refer to
        return reading.result()

    async def _read(self) -> Answer:
        answer = await self._source()
        self._ended_s = self._monotonic_s()
        return answer

    def _is_old(self, reading: "asyncio.Task[Answer]") -> bool:
        if not reading.done():
            return False
        failed = reading.cancelled() or reading.exception() is not None
        return failed or self._monotonic_s() - self._ended_s > self._max_age_s

    def _resume(self, waiting: "deque[asyncio.Future[None]]", reading: "asyncio.Task[Answer]") -> None:
        """Let those who wait for the reading go on, MAX_RESUMED_A_TURN in each turn."""
        if not reading.cancelled():
            reading.exception()  # retrieved, so that asyncio does not log what nobody waits for
        self._resume_some(waiting)

    def _resume_some(self, waiting: "deque[asyncio.Future[None]]") -> None:
        resumed = 0
        while waiting and resumed < MAX_RESUMED_A_TURN:
            if not (one := waiting.popleft()).done():
                one.set_result(None)
                resumed += 1
        if waiting:
            asyncio.get_running_loop().call_soon(self._resume_some, waiting)
