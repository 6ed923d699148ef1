"""Where the operator's requests reach a run that waits: one at a time, each answered or refused, none lost."""

import asyncio
from dataclasses import dataclass
from typing import Literal

from daemon.errors import CellBusy, DaemonError, RunOver
from drivers.errors import DeviceError

OperatorAction = Literal["a view", "the end"]


@dataclass(frozen=True)
class OperatorRequest:
    """One request of the operator, who waits for its answer."""

    action: OperatorAction
    _answer: asyncio.Future[None]

    def complete(self) -> None:
        """It is done."""
        if not self._answer.done():
            self._answer.set_result(None)

    def refuse(self, why: DaemonError | DeviceError) -> None:
        """It is not done, and the operator is told why."""
        if not self._answer.done():
            self._answer.set_exception(why)


class OperatorRequestQueue:
    """Between the interface, which asks, and the run, which answers."""

    def __init__(self) -> None:
        self._pending: OperatorRequest | None = None
        self._queue: asyncio.Queue[OperatorRequest] = asyncio.Queue(1)
        self._closed = False

    async def submit(self, wish: OperatorAction) -> None:
        """Returns when it is done. Raises CellBusy, RunOver, and what the run refuses with."""
        if self._closed:
            raise RunOver("the run is ending, and takes no more views", "look at its result, or start another")
        if self._pending is not None:
            raise CellBusy("the view that is being taken")
        answer = asyncio.get_running_loop().create_future()
        answer.add_done_callback(lambda done: done.cancelled() or done.exception())  # somebody may have hung up
        self._pending = OperatorRequest(wish, answer)
        self._queue.put_nowait(self._pending)
        await asyncio.shield(answer)  # who asked may hang up; what was asked for is done all the same

    async def next(self, limit_s: float) -> OperatorRequest:
        """What the operator asks for next; the one before counts as answered. Raises TimeoutError."""
        self._pending = None
        async with asyncio.timeout(limit_s):
            return await self._queue.get()

    def close(self) -> None:
        """The run takes no more requests; one that is under way is told so."""
        self._closed = True
        if self._pending is not None:
            self._pending.refuse(RunOver("the run ended before it was done", "look at why, with GET /runs/{id}"))
