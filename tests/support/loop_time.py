"""A clock for what runs in the test's event loop: time in which that loop was kept from running does not count.

A mock controller disarms after two seconds without a sign of life. On a busy machine the loop that sends those signs
and hears them may stand still for as long.
"""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from time import monotonic

PERIOD_S = 0.02
MAX_TURN_S = 0.05


@asynccontextmanager
async def loop_time() -> AsyncIterator[Callable[[], float]]:
    """Seconds, monotonic, in any thread; of each turn of this loop at most `MAX_TURN_S` counts."""
    loop = asyncio.get_running_loop()
    mark = (0.0, monotonic())

    def clock() -> float:
        passed_s, since_s = mark
        return passed_s + min(monotonic() - since_s, MAX_TURN_S)

    def turn() -> None:
        nonlocal mark, timer
        now_s = monotonic()
        mark = (mark[0] + min(now_s - mark[1], MAX_TURN_S), now_s)
        timer = loop.call_later(PERIOD_S, turn)

    timer = loop.call_later(PERIOD_S, turn)
    try:
        yield clock
    finally:
        timer.cancel()
