"""Work in the background: the services of the daemon, one that is one task, and the end of a task."""

import asyncio
from collections.abc import Iterable
from contextlib import suppress
from typing import Any

from daemon.runtime.metrics import Metric


async def end_task(task: asyncio.Task[Any] | None) -> None:
    """Cancel the task, where there is one, and wait until it has ended."""
    if task is not None:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


class Service:
    """What is started and stopped with the daemon, and may have warnings and metrics; by itself it does nothing."""

    async def start(self) -> None:
        """Begin its work. Raises DaemonError."""

    async def stop(self) -> None:
        """End its work."""

    def warnings(self) -> list[str]:
        """Conditions that need attention although work goes on, for GET /ready."""
        return []

    def families(self) -> Iterable[Metric]:
        """Its families of GET /metrics."""
        return ()


class SectionService(Service):
    """A service of a section of the settings that may be reloaded."""

    async def change(self, settings: Any, /) -> None:
        """Serve by this section from now on. Raises DaemonError; then what was before goes on."""
        raise NotImplementedError


class InBackground(Service):
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
