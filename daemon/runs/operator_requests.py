"""Queue of operator requests to a waiting run: one at a time, each completed or refused."""

import asyncio
from dataclasses import dataclass
from typing import Literal

from calibration.sentences.sentence import Sentence
from daemon.errors import CellBusy, DaemonError, OperatorTimeout, RunOver
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
    """Passes requests from the interface to the run, which waits for each up to `limit_s`."""

    def __init__(self, limit_s: float) -> None:
        self._limit_s = limit_s
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

    async def next(self) -> OperatorRequest:
        """Wait for the next request; the previous one must be answered. Raises OperatorTimeout."""
        self._pending = None
        try:
            async with asyncio.timeout(self._limit_s):
                return await self._queue.get()
        except TimeoutError:
            what = Sentence("nobody-asked", limit_s=self._limit_s)
            raise OperatorTimeout(what, Sentence("start-when-somebody-is-there")) from None

    def close(self) -> None:
        """Accept no more requests, and refuse a pending one."""
        self._closed = True
        if self._pending is not None:
            self._pending.refuse(RunOver(Sentence("run-ended-before-done"), Sentence("look-why", run="{id}")))
