"""Time and names as parameters, so that a test decides both."""

import asyncio
import secrets
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from datetime import UTC, datetime


def _utc_now() -> datetime:
    return datetime.now(UTC)


@dataclass(frozen=True)
class Clock:
    """`monotonic_s` is the clock the drivers stamp their readings with."""

    monotonic_s: Callable[[], float] = time.monotonic
    utc_now: Callable[[], datetime] = _utc_now
    sleep: Callable[[float], Awaitable[None]] = asyncio.sleep

    def timestamp(self) -> str:
        """2026-11-21T09:00:00.123Z"""
        return self.utc_now().isoformat(timespec="milliseconds").replace("+00:00", "Z")


def time_ordered_id(clock: Clock) -> str:
    """20261121-090000-3f9a1c: sorts by time, and can be read out over a telephone."""
    return f"{clock.utc_now():%Y%m%d-%H%M%S}-{secrets.token_hex(3)}"
