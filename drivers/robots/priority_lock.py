"""An asyncio lock, first come first served, with priority for urgent requests."""

import asyncio
from collections import OrderedDict
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

Turns = OrderedDict[asyncio.Future[None], None]


class PriorityLock:
    """An asyncio lock whose urgent waiters go first; a waiter that is cancelled leaves the queue."""

    def __init__(self) -> None:
        self._taken = False
        self._urgent: Turns = OrderedDict()
        self._ordinary: Turns = OrderedDict()

    @property
    def waiting(self) -> int:
        """Number of waiters."""
        return len(self._urgent) + len(self._ordinary)

    @asynccontextmanager
    async def hold(self, *, urgent: bool = False) -> AsyncIterator[None]:
        """Hold the lock; waits for it."""
        await self._enter(self._urgent if urgent else self._ordinary)
        try:
            yield
        finally:
            self._leave()

    async def _enter(self, queue: Turns) -> None:
        if not self._taken:
            self._taken = True
            return
        turn: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        queue[turn] = None
        try:
            await turn
        except asyncio.CancelledError:
            queue.pop(turn, None)
            if turn.done() and not turn.cancelled():
                self._leave()  # the lock was granted at the moment of cancellation: pass it on
            raise

    def _leave(self) -> None:
        for queue in (self._urgent, self._ordinary):
            while queue:
                turn, _ = queue.popitem(last=False)
                if not turn.done():
                    turn.set_result(None)
                    return
        self._taken = False
