"""Waits between attempts to reach a device: growing, capped, with jitter."""

from collections.abc import Callable

STEPS_S = (0.5, 1.0, 2.0, 5.0)
JITTER = 0.2
"""Each wait varies by up to this fraction, so that several clients do not retry at the same time."""


class Backoff:
    """Waits between attempts; `succeeded` restarts with the shortest."""

    def __init__(self, chance: Callable[[], float]) -> None:
        self._chance = chance
        self._failures = 0

    def next_wait_s(self) -> float:
        step_s = STEPS_S[min(self._failures, len(STEPS_S) - 1)]
        self._failures += 1
        return step_s * (1 + JITTER * (2 * self._chance() - 1))

    def reset(self) -> None:
        """Note that the device answered."""
        self._failures = 0
