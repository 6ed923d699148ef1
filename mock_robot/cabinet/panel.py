"""Switches of a controller cabinet, and the motion each position forbids."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from mock_robot.errors import NoSuchState
from protocols.cb.codes import Status


class Mode(Enum):
    """Operating mode: automatic, manual reduced speed, manual full speed."""

    AUTO = "AUTO"
    MANR = "MANR"
    MANF = "MANF"

    @classmethod
    def from_name(cls, name: str) -> "Mode":
        """The mode called `name`; raises NoSuchState."""
        try:
            return cls(name.upper())
        except ValueError:
            raise NoSuchState("mode", name, tuple(mode.value for mode in cls)) from None


@dataclass
class Panel:
    """Switch positions. `speed_override` of the pendant, 0 to 1. `cycle`: forever, or once and then stopped."""

    motors_on: bool = True
    mode: Mode = Mode.AUTO
    emergency_stop: bool = False
    program_running: bool = True
    speed_override: float = 1.0
    cycle: str = "forever"

    def forbids_motion(self) -> Status | None:
        return next((status for forbidden, status in _FORBIDDEN if forbidden(self)), None)


_FORBIDDEN: tuple[tuple[Callable[[Panel], bool], Status], ...] = (
    (lambda panel: panel.emergency_stop, Status.ESTOP),
    (lambda panel: not panel.motors_on, Status.MOTORS_OFF),
    (lambda panel: panel.mode is Mode.MANF, Status.WRONG_MODE),
    (lambda panel: not panel.program_running, Status.WRONG_MODE),
)
