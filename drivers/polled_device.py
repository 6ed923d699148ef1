"""A device that is polled in the background to know its link status."""

import asyncio
from abc import ABC, abstractmethod

from drivers.interfaces import LinkHealth
from drivers.link_status import LinkReport
from drivers.timing import Timing


class PolledDevice(ABC):
    """Polls `device` from `start` to `close`; a subclass implements the poll."""

    def __init__(self, device: str, timing: Timing) -> None:
        self.device, self._timing = device, timing
        self._report = LinkReport(timing.clock)
        self._task: asyncio.Task[None] | None = None

    @property
    def link(self) -> LinkHealth:
        return self._report.health

    def start(self) -> None:
        """Start polling; needs a running loop."""
        if self._task is None:
            self._task = asyncio.create_task(self._look(), name=f"looks for {self.device}")

    async def close(self) -> None:
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
            self._task = None
        self._report.down("closed")

    @abstractmethod
    async def _look(self) -> None:
        """Poll repeatedly and report each result."""
