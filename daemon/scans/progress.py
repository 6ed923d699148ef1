"""How far a job in a thread is, passed on to the event loop now and then, and how it is stopped."""

import asyncio
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


class JobStop:
    """Stops a job in a thread that asks `is_set` after each step. During a run a step is followed by as long a rest.

    A lower priority is no substitute: a thread of little that holds Python's lock keeps everybody waiting.
    """

    def __init__(self, run_in_progress: Callable[[], bool], monotonic_s: Callable[[], float]) -> None:
        self._run_in_progress, self._monotonic_s = run_in_progress, monotonic_s
        self._stop, self._at_s = threading.Event(), monotonic_s()

    def set(self) -> None:
        """Let the job end with its step; it rests no longer."""
        self._stop.set()

    def is_set(self) -> bool:
        """Whether the job shall end, after the rest."""
        if self._run_in_progress():
            self._stop.wait(self._monotonic_s() - self._at_s)
        self._at_s = self._monotonic_s()
        return self._stop.is_set()
