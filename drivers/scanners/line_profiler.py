"""What line profilers have in common: profiles go to the one sweep that listens, and nothing is kept without one."""

import asyncio
from collections.abc import AsyncIterator

from drivers.errors import DeviceError, DeviceTaken, DeviceUnreachable, StreamStalled, SweepNeeded
from drivers.interfaces import ScannedCloud
from drivers.polled_device import PolledDevice
from drivers.timing import Timing
from registration.profiles.profile_block import ProfileBlock

MAX_QUEUED_BLOCKS = 64
"""Blocks that wait for the sweep; the device then waits, too."""


class LineProfiler(PolledDevice):
    """drivers.interfaces.ProfileSource, and Scanner for its link: a profiler takes no whole clouds.

    A subclass delivers blocks and losses from its poll.
    """

    fix: str
    """What to check when no profiles come."""
    lag_s: float = 0.0
    lost_profiles: int = 0

    def __init__(self, device: str, timing: Timing, limit_s: float) -> None:
        super().__init__(device, timing)
        self._limit_s = limit_s
        self._queue: asyncio.Queue[ProfileBlock | DeviceError] | None = None
        self._offset_s: float | None = None
        """This machine's clock minus the sensor's, the same throughout a sweep; None before its first profile."""

    async def scan(self, newer_than_s: float) -> ScannedCloud:
        """Raises SweepNeeded."""
        raise SweepNeeded(self.device)

    async def profiles(self) -> AsyncIterator[ProfileBlock]:
        """Blocks from now on, their times in seconds of the driver's clock. Ends with a DeviceError only."""
        if not self.link.connected:
            raise DeviceUnreachable(self.device, self.link.detail, self.fix)
        if self._queue is not None:
            raise DeviceTaken(self.device, "another sweep takes its profiles", "end that sweep first")
        queue = self._queue = asyncio.Queue(MAX_QUEUED_BLOCKS)
        self._offset_s = None
        try:
            while True:
                arrival = asyncio.ensure_future(queue.get())
                try:
                    if not await self._timing.wait_until_done(arrival, self._limit_s):
                        raise StreamStalled(self.device, f"no profile came in {self._limit_s:g} s", self.fix)
                finally:
                    arrival.cancel()
                block = arrival.result()
                if isinstance(block, DeviceError):
                    raise block
                yield block
        finally:
            self._queue = None
            while not queue.empty():  # a delivery that waits for a place goes on
                queue.get_nowait()

    @property
    def wanted(self) -> bool:
        """Whether a sweep listens."""
        return self._queue is not None

    async def _deliver(self, arrival: ProfileBlock | DeviceError) -> None:
        """Hand it to the sweep, if there is one; waits while its queue is full."""
        if self._queue is not None:
            await self._queue.put(arrival)
