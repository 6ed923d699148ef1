"""Work in the background: a service that is one task, and the end of a task."""

import asyncio
from contextlib import suppress
from typing import Any


async def end_task(task: asyncio.Task[Any] | None) -> None:
    """Cancel the task, where there is one, and wait until it has ended."""
    if task is not None:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


class InBackground:
    """A service that is one task, `run`, from its start to its stop."""

    _task: asyncio.Task[None] | None = None

    async def start(self) -> None:
        """Start `run`; it has the name of the class in the report of a hang."""
        self._task = asyncio.create_task(self.run(), name=type(self).__name__)

    async def stop(self) -> None:
        """Cancel `run`, where it was started, and wait until it has ended."""
        await end_task(self._task)

    async def run(self) -> None:
        """The work; it may end by itself."""
        raise NotImplementedError
