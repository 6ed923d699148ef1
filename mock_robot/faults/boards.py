"""All faults of a cell behind one interface: those of the controller and its links, those of camera and scanner."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from mock_robot.cabinet.cabinet import Cabinet
from mock_robot.errors import NoSuchState, UnknownFault
from mock_robot.faults.board import Fault, FaultBoard
from protocols.cb.codes import Command

if TYPE_CHECKING:
    from mock_robot.faults.device_faults import DeviceFault, DeviceFaultBoard


@dataclass(frozen=True)
class FaultBoards:
    """Dispatches to the right board. `devices` is None for a cell without camera and scanner."""

    controller: Cabinet
    robot: FaultBoard
    devices: "DeviceFaultBoard | None" = None

    @property
    def rows(self) -> "dict[str, Fault | DeviceFault]":
        """All faults available in this cell, by name."""
        return {**self.robot.table, **(self.devices.table if self.devices is not None else {})}

    @property
    def active(self) -> list[str]:
        """Names of the faults that are on."""
        return sorted([*self.robot.active, *(self.devices.active if self.devices is not None else ())])

    def switch_on(
        self, name: str, now_s: float, *, strikes: int | None = None, only: Command | None = None, after_moves: int = 0
    ) -> None:
        """Switch a fault on. Raises UnknownFault, and NoSuchState for a condition that camera and scanner lack."""
        if name not in self.rows:
            raise UnknownFault(name, tuple(self.rows))
        if self.devices is None or name in self.robot.table:
            self.robot.switch_on(name, self.controller, now_s, strikes=strikes, only=only, after_moves=after_moves)
            return
        if only is not None or after_moves:
            raise NoSuchState("condition of a camera or scanner fault", "only or after_moves", ("strikes",))
        self.devices.switch_on(name, strikes)

    def clear(self, now_s: float, name: str | None = None) -> None:
        """Switch one fault off, or all of them. Raises UnknownFault."""
        if name is not None and name not in self.rows:
            raise UnknownFault(name, tuple(self.rows))
        if name is None or name in self.robot.table:
            self.robot.clear(self.controller, now_s, name)
        if self.devices is not None and (name is None or name not in self.robot.table):
            self.devices.clear(name)
