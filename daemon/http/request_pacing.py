"""Lets few requests begin in each turn of the event loop, and aborts before all that wait.

Without it a thousand requests that arrive together make one turn as long as all of them, and whatever needs several
turns, such as an abort with its telegrams to the controller, waits for all of them several times.
"""

import asyncio
from collections import deque
from collections.abc import Callable

MAX_BEGUN_A_TURN = 2
"""A request takes about a millisecond in all, so that a turn takes a few."""

MAX_HOLD_S = 0.5
"""Others begin again after so long, whatever holds them."""


class RequestPacing:
    """Calls MAX_BEGUN_A_TURN functions in each turn of the event loop: urgent ones first, the others as they came."""

    def __init__(self) -> None:
        self._urgent: deque[Callable[[], None]] = deque()
        self._others: deque[Callable[[], None]] = deque()
        self._begun = 0
        self._scheduled = False
        self._release: asyncio.TimerHandle | None = None

    @property
    def held(self) -> bool:
        """True while only urgent ones begin."""
        return self._release is not None

    def hold(self) -> None:
        """Let only urgent ones begin until `release`, for MAX_HOLD_S at most: turns are short meanwhile."""
        if self._release is None:
            self._release = asyncio.get_running_loop().call_later(MAX_HOLD_S, self.release)

    def release(self) -> None:
        """Let the others begin again."""
        if self._release is not None:
            self._release.cancel()
            self._release = None
            self._schedule()

    def take(self) -> bool:
        """Take one of this turn's places; False when all are taken or somebody waits for one."""
        if self.held or self._urgent or self._others or self._begun >= MAX_BEGUN_A_TURN:
            return False
        self._schedule()
        self._begun += 1
        return True

    def wait(self, begin: Callable[[], None], *, urgent: bool) -> None:
        """Call `begin` in a later turn."""
        self._schedule()
        (self._urgent if urgent else self._others).append(begin)

    @property
    def _queue(self) -> deque[Callable[[], None]]:
        """Where the next one is taken from."""
        return self._urgent if self._urgent or self.held else self._others

    def _schedule(self) -> None:
        if not self._scheduled:
            self._scheduled = True
            asyncio.get_running_loop().call_soon(self._begin_next)

    def _begin_next(self) -> None:
        """Call the next ones, and come again in the next turn while there are any."""
        self._begun, self._scheduled = 0, False
        if self._queue:  # before they are called: an error of one holds no other up
            self._schedule()
        while self._begun < MAX_BEGUN_A_TURN and (queue := self._queue):
            self._begun += 1
            queue.popleft()()
