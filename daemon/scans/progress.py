"""How far a job in a thread is, passed on to the event loop now and then, and how it is stopped."""

import asyncio
import math
import threading
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


class StepEnd:
    """Whether `stop` is set, asked by a job in a thread after each step. During a run it rests for as long first.

    A lower priority is no substitute: a thread of little that holds Python's lock keeps everybody waiting.
    """

    def __init__(
        self, stop: threading.Event, run_in_progress: Callable[[], bool], monotonic_s: Callable[[], float]
    ) -> None:
        self._stop, self._run_in_progress, self._monotonic_s = stop, run_in_progress, monotonic_s
        self._at_s = math.inf

    def __call__(self) -> bool:
        """The first call, as the job begins, does not rest."""
        if self._run_in_progress() and (worked_s := self._monotonic_s() - self._at_s) > 0:
            self._stop.wait(worked_s)
        self._at_s = self._monotonic_s()
        return self._stop.is_set()
