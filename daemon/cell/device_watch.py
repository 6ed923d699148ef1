"""Notes when each device's link goes up and down, and its last error."""

from dataclasses import dataclass, replace

from daemon.cell.cell import Cell
from daemon.runtime.clock import Clock
from daemon.runtime.event_bus import Publish
from daemon.runtime.tasks import InBackground
from drivers.errors import DeviceError, DeviceUnreachable
from drivers.interfaces import LinkHealth

CHECK_S = 0.5
"""Interval of looking at the links: their drivers keep them up, and nothing is sent to a device for this."""

FIX = "check its power, cable and address: handeyed check asks every device"


@dataclass(frozen=True)
class DeviceFault:
    """An error of a device: a stable code, a sentence, what to do, and when it was noted."""

    code: str
    what: str
    fix: str
    at: str


@dataclass(frozen=True)
class DeviceState:
    """The link of a device. `since`: of being connected, or of not being so; `last_error` stays when it is over."""

    name: str
    connected: bool
    detail: str
    since: str
    last_error: DeviceFault | None = None


class DeviceWatch(InBackground):
    """Background service: the state of each device, and an event `device` for each link that goes up or down."""

    def __init__(self, cell: Cell, clock: Clock, publish: Publish) -> None:
        self._cell, self._clock, self._publish = cell, clock, publish
        self._states: dict[str, DeviceState] = {}

    def states(self) -> tuple[DeviceState, ...]:
        """The state of each device now, by what its driver knows: nothing is sent to the device."""
        for name, device in self._cell.links().items():
            self._look(name, device.link)
        return tuple(self._states.values())

    def note(self, name: str, error: DeviceError) -> None:
        """Keep an error of a reading of the device `name` as its last one."""
        self.states()
        self._states[name] = replace(
            self._states[name], last_error=DeviceFault(error.code, error.what, error.fix, self._clock.timestamp())
        )

    async def run(self) -> None:
        while True:
            self.states()
            await self._clock.sleep(CHECK_S)

    def _look(self, name: str, link: LinkHealth) -> None:
        before, now = self._states.get(name), self._clock.timestamp()
        if before is not None and before.connected == link.connected:
            if before.detail != link.detail:
                self._states[name] = replace(before, detail=link.detail)
            return
        fault = before.last_error if before else None
        if not link.connected:
            fault = DeviceFault(DeviceUnreachable.code, link.detail, FIX, now)
        self._states[name] = DeviceState(name, link.connected, link.detail, now, fault)
        if before is not None:
            code, fix = (fault.code, fault.fix) if fault and not link.connected else (None, None)
            data = {"name": name, "connected": link.connected, "detail": link.detail, "code": code, "fix": fix}
            self._publish("device", {**data, "at": now})
