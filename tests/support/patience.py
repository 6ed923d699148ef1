"""Patience with a busy machine: time in which a test's event loop was kept from running does not count.

Client and server of most tests, devices and drivers, share one loop. On a busy machine it may stand still for seconds,
or take ten times as long for each turn: a limit that passes meanwhile would end what is about to be answered.
"""

import asyncio
import selectors
import threading
from collections.abc import Coroutine
from time import monotonic
from typing import Any, TypeVar

Result = TypeVar("Result")
MAX_TURN_S = 0.05


class PatientClock:
    """While a PatientLoop runs, each of its turns counts as `MAX_TURN_S` at most; otherwise time is the machine's."""

    def __init__(self) -> None:
        self._lock = threading.RLock()  # loops in several threads; a handler of a signal may ask as well
        self._mark = (monotonic(), monotonic())
        self._running: set[PatientLoop] = set()

    def now_s(self) -> float:
        """Seconds, monotonic, in any thread."""
        with self._lock:
            return self._at(monotonic())

    def turn(self) -> None:
        with self._lock:
            now_s = monotonic()
            self._mark = (self._at(now_s), now_s)

    def begin(self, loop: "PatientLoop") -> None:
        with self._lock:
            self.turn()
            self._running.add(loop)

    def end(self, loop: "PatientLoop") -> None:
        with self._lock:
            self.turn()
            self._running.remove(loop)

    def _at(self, monotonic_s: float) -> float:
        passed_s, since_s = self._mark
        turn_s = monotonic_s - since_s
        return passed_s + (min(turn_s, MAX_TURN_S) if self._running else turn_s)


CLOCK = PatientClock()
"""tests/conftest.py makes it the `time.monotonic` of the tests' process, which product and asyncio ask."""


class _TurningSelector(selectors.DefaultSelector):
    """Waits in turns."""

    def select(self, timeout: float | None = None) -> Any:
        ends_s = float("inf") if timeout is None else CLOCK.now_s() + timeout
        while True:
            CLOCK.turn()
            found = super().select(min(ends_s - CLOCK.now_s(), MAX_TURN_S))
            CLOCK.turn()
            if found or CLOCK.now_s() >= ends_s:
                return found


class PatientLoop(asyncio.SelectorEventLoop):
    """The loop of every asynchronous test and fixture."""

    def __init__(self) -> None:
        super().__init__(_TurningSelector())

    def time(self) -> float:
        """Of the clock, also in a program that leaves `time.monotonic` as it is."""
        return CLOCK.now_s()

    def run_forever(self) -> None:
        CLOCK.begin(self)
        try:
            super().run_forever()
        finally:
            CLOCK.end(self)


def run_patiently(act: Coroutine[Any, Any, Result]) -> Result:
    """The result of `act`, run in a PatientLoop of its own: `asyncio.run` for tests."""
    with asyncio.Runner(loop_factory=PatientLoop) as runner:
        return runner.run(act)
