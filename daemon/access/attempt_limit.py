"""A limit of attempts per network and minute."""

from collections import OrderedDict, deque
from collections.abc import Callable

MAX_ATTEMPTS = 10
WINDOW_S = 60.0
MAX_NETWORKS = 10_000
"""Networks that are remembered; the one that tried longest ago is forgotten for one more."""


class AttemptLimit:
    """Counts attempts: MAX_ATTEMPTS in WINDOW_S for each network, successful or not."""

    def __init__(self, monotonic_s: Callable[[], float]) -> None:
        self._monotonic_s = monotonic_s
        self._attempts: OrderedDict[str, deque[float]] = OrderedDict()

    def allows(self, network: str) -> bool:
        """Count one attempt; False when there were too many. A refused attempt is not counted."""
        now_s = self._monotonic_s()
        times = self._attempts.setdefault(network, deque())
        self._attempts.move_to_end(network)
        while len(self._attempts) > MAX_NETWORKS:
            self._attempts.popitem(last=False)
        while times and now_s - times[0] >= WINDOW_S:
            times.popleft()
        if len(times) >= MAX_ATTEMPTS:
            return False
        times.append(now_s)
        return True
