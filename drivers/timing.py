"""Time and chance as the drivers use them, handed in so that a test need not wait."""

import asyncio
import random
import sys
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any

TURN_S = 2e-4
"""Python's own 5 ms are longer than a packet of EGM or a pose takes."""


def take_turns_often() -> None:
    """Who waits for a device gets the interpreter soon, though clouds pass through another thread of this process."""
    sys.setswitchinterval(min(sys.getswitchinterval(), TURN_S))


@dataclass(frozen=True)
class Timing:
    """A monotonic clock in seconds, a sleep that goes with it, and chance in [0, 1)."""

    clock: Callable[[], float] = time.monotonic
    sleep: Callable[[float], Awaitable[None]] = asyncio.sleep
    chance: Callable[[], float] = random.random

    async def done_within(self, future: "asyncio.Future[Any]", limit_s: float) -> bool:
        """Wait for a future, but not longer than `limit_s`; it is left running. Is it done?"""
        if future.done():
            return True
        timer = asyncio.ensure_future(self.sleep(limit_s))
        try:
            await asyncio.wait({future, timer}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            timer.cancel()
        return future.done()
