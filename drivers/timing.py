"""Clock, sleep and random numbers of the drivers, injectable for tests."""

import asyncio
import random
import sys
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any

SWITCH_INTERVAL_S = 2e-4
"""Thread switch interval in s; Python's default of 5 ms is longer than a packet of EGM or a pose takes."""


def shorten_switch_interval() -> None:
    """Shorten the thread switch interval, so that device threads run soon beside threads that process clouds."""
    sys.setswitchinterval(min(sys.getswitchinterval(), SWITCH_INTERVAL_S))


def retrieve_error(done: "asyncio.Future[Any]") -> None:
    """Retrieve an error that nobody asks for, or asks for in time, so that asyncio does not log it."""
    if not done.cancelled():
        done.exception()


@dataclass(frozen=True)
class Timing:
    """A monotonic clock in seconds, the matching sleep, and random numbers in [0, 1)."""

    clock: Callable[[], float] = time.monotonic
    sleep: Callable[[float], Awaitable[None]] = asyncio.sleep
    chance: Callable[[], float] = random.random

    async def wait_until_done(self, future: "asyncio.Future[Any]", limit_s: float) -> bool:
        """Wait up to `limit_s` for a future without cancelling it; returns whether it is done."""
        if future.done():
            return True
        timer = asyncio.ensure_future(self.sleep(limit_s))
        try:
            await asyncio.wait({future, timer}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            timer.cancel()
        return future.done()
