"""The clocks and the run ids, passed as a parameter so that tests control them."""

import secrets
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from datetime import UTC, datetime


async def _sleep(seconds: float) -> None:
    import asyncio  # commands read a clock, and never sleep

    await asyncio.sleep(seconds)


@dataclass(frozen=True)
class Clock:
    """Monotonic time, UTC time and sleep. `monotonic_s` is the clock with which the drivers stamp their readings."""

    monotonic_s: Callable[[], float] = time.monotonic
    utc_now: Callable[[], datetime] = lambda: datetime.now(UTC)
    sleep: Callable[[float], Awaitable[None]] = _sleep

    def timestamp(self) -> str:
        """The UTC time as ISO 8601 with milliseconds: 2026-11-21T09:00:00.123Z."""
        return self.utc_now().isoformat(timespec="milliseconds").replace("+00:00", "Z")


def time_ordered_id(clock: Clock) -> str:
    """An id such as 20261121-090000-3f9a1c: UTC time to the second and 24 random bits. Sorts by time."""
    return f"{clock.utc_now():%Y%m%d-%H%M%S}-{secrets.token_hex(3)}"
