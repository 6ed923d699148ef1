"""How far a job in a thread is, passed on to the event loop now and then."""

import asyncio
from collections.abc import Callable

STEP, INTERVAL_S = 0.05, 1.0
"""Least increase and least time between two reports: twenty at the most of one job, none of one below a second."""


class ProgressReports:
    """Takes the share of a job that is done, 0 to 1, in its thread; calls `report` in the event loop with some of them.

    The shares reported increase. Made in the event loop.
    """

    def __init__(self, report: Callable[[float], None], monotonic_s: Callable[[], float]) -> None:
        self._report, self._monotonic_s = report, monotonic_s
        self._loop = asyncio.get_running_loop()
        self._share, self._at_s = 0.0, monotonic_s()

    def __call__(self, share: float) -> None:
        now_s = self._monotonic_s()
        if share >= self._share + STEP and now_s >= self._at_s + INTERVAL_S:
            self._share, self._at_s = share, now_s
            self._loop.call_soon_threadsafe(self._report, share)
