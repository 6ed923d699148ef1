"""Services of a task's instructions: arm, panel, devices, wires, interrupts, event log."""

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from mock_robot.cabinet.panel import Panel
from mock_robot.rapid.devices import SerialLine
from mock_robot.rapid.frames import FrameFaultBoard
from mock_robot.rapid.interrupts import Interrupts
from mock_robot.rapid.scope import ErrorNumbers
from mock_robot.rapid.signals import Signal
from mock_robot.rapid.unit import MotionUnit


@dataclass
class OpenDevices:
    """Open devices, the controller's addresses, and whether clients can connect.

    `virtual`: RobotStudio's controller, which has no address of its own. Without `network`, nothing can be bound, and
    a listening socket is closed.
    """

    host: str = "127.0.0.1"
    virtual: bool = False
    network: bool = True
    lines: dict[str, SerialLine] = field(default_factory=dict)
    address: tuple[str, int] | None = None
    reachable: threading.Event = field(default_factory=threading.Event)
    _open: dict[int, Any] = field(default_factory=dict)

    def add(self, device: Any) -> None:
        """Register an open device."""
        self._open[id(device)] = device

    def drop(self, device: Any) -> None:
        """Forget a closed device."""
        self._open.pop(id(device), None)

    def note_address(self, address: tuple[str, int]) -> None:
        """Note the address of a bound socket."""
        self.address = address

    def note_listening(self) -> None:
        """Note that clients can connect; input of a serial line from before may be discarded."""
        self.reachable.set()

    def close(self) -> None:
        """Close everything."""
        for device in list(self._open.values()):
            device.close()
        self._open.clear()
        self.reachable.clear()


MAX_CLOCK_S = 4_294_967.0
"""After 49 days and 17 hours a controller's clock overflows."""


@dataclass(frozen=True)
class Services:
    """Services of one task. `max_clock_s`: the age at which its clocks overflow.

    `egm_devices`: by name the port they send to, None where the mock's own sender does.
    """

    unit: MotionUnit
    panel: Panel
    devices: OpenDevices
    wire: FrameFaultBoard
    interrupts: Interrupts
    errors: ErrorNumbers
    note: Callable[[int, str], None]
    max_clock_s: float = MAX_CLOCK_S
    signals: Mapping[str, Signal] = field(default_factory=dict)
    egm_devices: Mapping[str, int | None] = field(default_factory=dict)
