"""Measures how long the event loop is kept by one turn: while one answer is made on the loop, all others wait."""

import asyncio
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from daemon.runtime.metrics import Labels, Metric
from daemon.runtime.tasks import Service

PERIOD_S = 0.02
"""A timer that is due this often; what it is late by, the loop was kept. 50 wake-ups a second take 0.2 % of a core."""

WINDOW_S = 60.0
"""A stall is reported for one to two windows, so that every scrape within a minute reports it."""


@dataclass(frozen=True)
class Stall:
    """How long one turn of the event loop took. `processor_s` leaves out what other processes took meanwhile."""

    wall_s: float = 0.0
    processor_s: float = 0.0

    def or_longer(self, other: "Stall") -> "Stall":
        """The longer of the two, by each clock."""
        return Stall(max(self.wall_s, other.wall_s), max(self.processor_s, other.processor_s))


class EventLoopMonitor(Service):
    """Measures the longest turn of the event loop it was started in."""

    def __init__(
        self,
        wall_s: Callable[[], float] = time.perf_counter,
        processor_s: Callable[[], float] = time.thread_time,
        period_s: float = PERIOD_S,
    ) -> None:
        """`wall_s`, `processor_s`: clocks in seconds, the second one counts the processor time of the loop's thread."""
        self._wall_s, self._processor_s, self._period_s = wall_s, processor_s, period_s
        self._due_s = self._processor_before_s = self._window_ends_s = 0.0
        self._recent = self._earlier = Stall()
        self._timer: asyncio.TimerHandle | None = None

    async def start(self) -> None:
        self.reset()
        self._schedule()

    async def stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()

    def reset(self) -> None:
        """Forget what was measured."""
        self._recent = self._earlier = Stall()
        self._window_ends_s = self._wall_s() + WINDOW_S

    def longest(self) -> Stall:
        """The longest turn of the last one to two windows, or since `reset`."""
        return self._recent.or_longer(self._earlier)

    def families(self) -> Iterable[Metric]:
        """The metrics of the longest turn."""
        longest = self.longest()
        about = "Longest turn of the event loop in the last two minutes, by the wall clock and in processor time."
        samples: dict[Labels, float] = {
            (("clock", "wall"),): longest.wall_s,
            (("clock", "processor"),): longest.processor_s,
        }
        return [Metric("handeyed_event_loop_stall_seconds", "gauge", about, samples)]

    def _schedule(self) -> None:
        self._due_s, self._processor_before_s = self._wall_s() + self._period_s, self._processor_s()
        self._timer = asyncio.get_running_loop().call_later(self._period_s, self._measure)

    def _measure(self) -> None:
        """What the timer is late by; of the processor time since it was set at most as much."""
        now_s = self._wall_s()
        late_s = max(0.0, now_s - self._due_s)
        stall = Stall(late_s, min(late_s, self._processor_s() - self._processor_before_s))
        if now_s > self._window_ends_s:
            self._recent, self._earlier, self._window_ends_s = Stall(), self._recent, now_s + WINDOW_S
        self._recent = self._recent.or_longer(stall)
        self._schedule()
