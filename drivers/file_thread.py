"""Blocking calls on files and libraries in a thread of their own: a share that hangs does not hold the process."""

import asyncio
import threading
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any, TypeVar

from drivers.timing import Timing

Answer = TypeVar("Answer")


class FileThread:
    """One blocking call at a time, in a daemon thread: the process ends without it."""

    def __init__(self, name: str, timing: Timing) -> None:
        self._name, self._timing = name, timing
        self._call: asyncio.Future[Any] | None = None

    async def run(self, work: Callable[[], Answer], limit_s: float) -> Answer:
        """The result of `work`, or its exception. Raises TimeoutError after `limit_s`; the thread is then left alone.

        While a call hangs no other is begun: each waits for it up to its own limit.
        """
        while self._call is not None and not self._call.done():
            await self._wait(self._call, limit_s)
        loop = asyncio.get_running_loop()
        call: asyncio.Future[Answer] = loop.create_future()
        self._call = call

        # An error is known then: a waiter that has left leaves no message about it.
        call.add_done_callback(lambda done: done.cancelled() or done.exception())

        def run_and_settle() -> None:
            try:
                settle = partial(call.set_result, work())
            except Exception as raised:  # noqa: BLE001 - raised where the result is awaited
                settle = partial(call.set_exception, raised)
            with suppress(RuntimeError):  # the loop was closed meanwhile
                loop.call_soon_threadsafe(settle)

        threading.Thread(target=run_and_settle, name=self._name, daemon=True).start()
        await self._wait(call, limit_s)
        return call.result()

    async def _wait(self, call: "asyncio.Future[Any]", limit_s: float) -> None:
        if not await self._timing.wait_until_done(call, limit_s):
            raise TimeoutError
