"""What happens to the handshake, and what it wants done."""

from dataclasses import dataclass

from protocols.plc.codes import Command, DriftState
from protocols.plc.results import Result


@dataclass(frozen=True)
class Written:
    """The PLC wrote the writable registers; these are all of them, from address 0 on, as they are now."""

    words: tuple[int, ...]


@dataclass(frozen=True)
class Accepted:
    """The daemon has begun what Start asked for."""


@dataclass(frozen=True)
class Refused:
    """The daemon has not, and why."""

    error_code: int


@dataclass(frozen=True)
class Progressed:
    """The command in progress goes on."""

    station: int
    stations: int


@dataclass(frozen=True)
class Ended:
    """The command in progress is over."""

    result: Result


@dataclass(frozen=True)
class CellSeen:
    """What else the PLC should know. `ready`: the daemon could start something now."""

    ready: bool
    in_force: bool = False
    calibration_age_s: int = 0
    drift: DriftState = DriftState.OFF
    drift_shift_um: int = 0


@dataclass(frozen=True)
class Beat:
    """So much time has passed."""

    seconds: float


Event = Written | Accepted | Refused | Progressed | Ended | CellSeen | Beat


@dataclass(frozen=True)
class Start:
    """Begin a command; answer with Accepted or Refused."""

    command: Command
    stations_wanted: int
    part_id: int


@dataclass(frozen=True)
class Abort:
    """Stop whatever run is in progress."""

    why: str


Effect = Start | Abort
