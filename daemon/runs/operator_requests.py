"""Queue of operator requests to a waiting run: one at a time, each completed or refused."""

import asyncio
from dataclasses import dataclass
from typing import Literal

from calibration.sentences.sentence import Sentence
from daemon.errors import CellBusy, DaemonError, RunOver
from daemon.runs.jog import Jog
from drivers.errors import DeviceError

OperatorAction = Literal["a view", "a jog", "the end"]


@dataclass(frozen=True)
class OperatorRequest:
    """One request of an operator, who waits for its completion."""

    action: OperatorAction
    _answer: asyncio.Future[None]
    jog: Jog | None = None

    def complete(self) -> None:
        if not self._answer.done():
            self._answer.set_result(None)

    def refuse(self, why: DaemonError | DeviceError) -> None:
        if not self._answer.done():
            self._answer.set_exception(why)


class OperatorRequestQueue:
    """Passes requests from the interface to the run."""

    def __init__(self) -> None:
        self._pending: OperatorRequest | None = None
        self._queue: asyncio.Queue[OperatorRequest] = asyncio.Queue(1)
        self._closed = False

    async def submit(self, wish: OperatorAction, jog: Jog | None = None) -> None:
        """Send a request and wait until it is done. Raises CellBusy, RunOver, and the reason of a refusal."""
        if self._closed:
            raise RunOver(Sentence("run-is-ending"), Sentence("look-or-start-another"))
        if self._pending is not None:
            raise CellBusy(Sentence("holder-jog") if self._pending.jog else Sentence("holder-picture"))
        answer = asyncio.get_running_loop().create_future()
        answer.add_done_callback(lambda done: done.cancelled() or done.exception())  # the client may have disconnected
        self._pending = OperatorRequest(wish, answer, jog)
        self._queue.put_nowait(self._pending)
        await asyncio.shield(answer)  # carried out even if the client disconnects

    async def next(self, limit_s: float) -> OperatorRequest:
        """Wait for the next request; the previous one must be answered. Raises TimeoutError."""
        self._pending = None
        async with asyncio.timeout(limit_s):
            return await self._queue.get()

    def close(self) -> None:
        """Accept no more requests, and refuse a pending one."""
        self._closed = True
        if self._pending is not None:
            self._pending.refuse(RunOver(Sentence("run-ended-before-done"), Sentence("look-why", run="{id}")))
