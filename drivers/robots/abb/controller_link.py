"""A link to a controller, whatever carries it, and what a robot passes on to its link."""

import asyncio

from drivers.backoff import Backoff
from drivers.errors import DeviceUnreachable
from drivers.interfaces import LinkHealth
from drivers.polled_device import PolledDevice
from drivers.timing import Timing


class ControllerLink(PolledDevice):
    """Connects in the background, and again with growing waits. `again`: what it does while nobody answers."""

    again: str

    def __init__(self, device: str, timing: Timing) -> None:
        super().__init__(device, timing)
        self._backoff = Backoff(timing.chance)
        self._connected = asyncio.Event()

    async def wait_for_link(self, limit_s: float) -> None:
        """Wait until the controller is connected; raises DeviceUnreachable with the last reason."""
        waiting = asyncio.ensure_future(self._connected.wait())
        in_time = await self._timing.wait_until_done(waiting, limit_s)
        waiting.cancel()
        if not in_time:
            raise self._unreachable()

    def _unreachable(self) -> DeviceUnreachable:
        return DeviceUnreachable(self.device, self.link.detail, self.again)


class LinkedRobot:
    """What a robot passes on to its link, which a subclass makes."""

    _link: ControllerLink

    @property
    def link(self) -> LinkHealth:
        return self._link.link

    def start(self) -> None:
        self._link.start()

    async def wait_for_link(self, limit_s: float) -> None:
        """Wait for the controller; raises DeviceUnreachable with the reason on timeout."""
        await self._link.wait_for_link(limit_s)

    async def close(self) -> None:
        """Take leave of the controller, and stop connecting."""
        await self._link.close()
