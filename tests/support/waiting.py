"""Waiting for a condition with a limit, and a time that only moves when told."""

import asyncio
import heapq
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import TypeVar

from drivers.errors import DeviceTimeout
from drivers.timing import Timing

Answer = TypeVar("Answer")

LIMIT_S = 200.0
"""Long enough for a machine whose cores are all busy with something else."""


async def eventually(condition: Callable[[], bool], limit_s: float = LIMIT_S) -> None:
    """Wait until `condition()` holds; fail when it does not in time."""
    deadline_s = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < deadline_s, "it did not happen in time"
        await asyncio.sleep(0.002)


async def patiently(ask: Callable[[], Awaitable[Answer]]) -> Answer:
    """What a device answers when it is asked again after each DeviceTimeout; other errors are raised."""
    async with asyncio.timeout(LIMIT_S):
        while True:
            with suppress(DeviceTimeout):
                return await ask()


def eventually_blocking(condition: Callable[[], bool], limit_s: float = LIMIT_S) -> None:
    """As `eventually`, where no event loop runs."""
    deadline_s = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < deadline_s, "it did not happen in time"
        time.sleep(0.005)


def quick_timing(factor: float = 4.0) -> Timing:
    """Real time that runs `factor` times faster."""

    async def sleep(duration_s: float) -> None:
        await asyncio.sleep(duration_s / factor)

    return Timing(clock=lambda: time.monotonic() * factor, sleep=sleep, chance=lambda: 0.5)


class SkippableTime:
    """Real time, of which a test may skip some: a generous limit is over at once when it has been skipped."""

    def __init__(self) -> None:
        self._skipped_s = 0.0

    @property
    def timing(self) -> Timing:
        return Timing(clock=self.clock, chance=lambda: 0.5)

    def clock(self) -> float:
        """Seconds, monotonic."""
        return time.monotonic() + self._skipped_s

    def skip(self, duration_s: float) -> None:
        """Let the clock jump; sleeps under way take as long as before."""
        self._skipped_s += duration_s


class FakeTime:
    """A clock that stands still, and sleeps that end when `advance` passes them."""

    def __init__(self) -> None:
        self.now_s = 1000.0
        self.slept_s: list[float] = []
        self._sleepers: list[tuple[float, int, asyncio.Future[None]]] = []

    @property
    def timing(self) -> Timing:
        return Timing(clock=lambda: self.now_s, sleep=self.sleep, chance=lambda: 0.5)

    async def sleep(self, duration_s: float) -> None:
        self.slept_s.append(duration_s)
        wake: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        heapq.heappush(self._sleepers, (self.now_s + duration_s, len(self.slept_s), wake))
        await wake

    async def advance(self, duration_s: float) -> None:
        """Let time pass, waking every sleeper in its order."""
        end_s = self.now_s + duration_s
        await settle()
        while self._sleepers and self._sleepers[0][0] <= end_s:
            wake_s, _, wake = heapq.heappop(self._sleepers)
            if not wake.done():
                self.now_s = max(self.now_s, wake_s)
                wake.set_result(None)
                await settle()
        self.now_s = end_s
        await settle()


async def settle() -> None:
    """Let everything run that can run without time passing."""
    for _ in range(30):
        await asyncio.sleep(0)
