"""What instructions reach from a task: the arm, the panel, the devices and their wires, interrupts, the event log."""

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from mock_robot.cabinet.panel import Panel
from mock_robot.rapid.devices import SerialLine
from mock_robot.rapid.frames import Garbling
from mock_robot.rapid.interrupts import Interrupts
from mock_robot.rapid.scope import ErrorNumbers
from mock_robot.rapid.unit import MotionUnit


@dataclass
class Devices:
    """Everything that was opened, the addresses the controller owns, and when somebody can connect."""

    host: str = "127.0.0.1"
    lines: dict[str, SerialLine] = field(default_factory=dict)
    address: tuple[str, int] | None = None
    reachable: threading.Event = field(default_factory=threading.Event)
    _open: dict[int, Any] = field(default_factory=dict)

    def add(self, device: Any) -> None:
        """It was opened."""
        self._open[id(device)] = device

    def drop(self, device: Any) -> None:
        """It was closed."""
        self._open.pop(id(device), None)

    def bound(self, address: tuple[str, int]) -> None:
        """A socket has this address."""
        self.address = address

    def listening(self) -> None:
        """Somebody may connect, or be heard: what came to a serial line before it was read may be thrown away."""
        self.reachable.set()

    def close(self) -> None:
        """Close everything."""
        for device in list(self._open.values()):
            device.close()
        self._open.clear()
        self.reachable.clear()


@dataclass(frozen=True)
class Services:
    """Of one task."""

    unit: MotionUnit
    panel: Panel
    devices: Devices
    wire: Garbling
    interrupts: Interrupts
    errors: ErrorNumbers
    note: Callable[[int, str], None]
