"""How long to wait before trying a device again: longer each time, capped, never in step with others."""

from collections.abc import Callable

STEPS_S = (0.5, 1.0, 2.0, 5.0)
JITTER = 0.2
"""Each wait is longer or shorter by up to this fraction, so that several clients do not knock together."""


class Backoff:
    """The waits between attempts; `succeeded` begins again with the shortest."""

    def __init__(self, chance: Callable[[], float], steps_s: tuple[float, ...] = STEPS_S) -> None:
        self._chance, self._steps_s = chance, steps_s
        self._failures = 0

    def next_wait_s(self) -> float:
        """The wait after one more failure."""
        step_s = self._steps_s[min(self._failures, len(self._steps_s) - 1)]
        self._failures += 1
        return step_s * (1 + JITTER * (2 * self._chance() - 1))

    def succeeded(self) -> None:
        """The device answered."""
        self._failures = 0
