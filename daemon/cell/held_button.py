"""A button on a screen that somebody holds while the arm moves. It is no enabling device: see SECURITY.md."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf

from daemon.errors import NotHeld

LEASE_S = 0.3
"""The arm is stopped when the last word that the button is held was sent longer ago than this."""

FIRST_S = 1.0
"""How long the arm waits, disarmed, for the first such word: one that was kept longer on the way begins no motion."""


@dataclass(eq=False)
class HeldButton:
    """Whether a button is still held. `by`: who asked for the motion.

    Once let go, or silent for LEASE_S, it is over: a word that comes later is refused, and moves nothing.
    """

    by: str
    first: asyncio.Event = field(default_factory=asyncio.Event)
    over: bool = False
    _stop: Callable[[], object] = bool
    _expiry: asyncio.TimerHandle | None = None
    _clocks_apart_s: float = inf

    def watch(self, stop: Callable[[], object]) -> None:
        """Call `stop` at the moment when it is over; FIRST_S from now when no word comes."""
        self._stop = stop
        self._expiry = asyncio.get_running_loop().call_later(FIRST_S, self.release)

    def renew(self, by: str, at_s: float) -> None:
        """It is held. `at_s`: when the screen said so, by a clock of its own. Raises NotHeld.

        The lease begins when the word was sent, not when it came: words that were kept on the way extend nothing.
        The way is taken to be as long as that of the quickest one, which is at most the first one's.
        """
        loop = asyncio.get_running_loop()
        if self.over or self._expiry is None or by != self.by:
            raise NotHeld
        self._clocks_apart_s = min(self._clocks_apart_s, loop.time() - at_s)
        until_s = self._clocks_apart_s + at_s + LEASE_S
        if self.first.is_set() and until_s <= self._expiry.when():
            return
        self._expiry.cancel()
        self._expiry = loop.call_at(until_s, self.release)
        self.first.set()

    def release(self) -> None:
        """It is let go: the arm stops, and does not go on."""
        if self._expiry is not None:
            self._expiry.cancel()
        if not self.over:
            self.over = True
            self._stop()
