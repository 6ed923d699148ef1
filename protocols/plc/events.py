"""Inputs (events) and outputs (effects) of the handshake."""

from dataclasses import dataclass

from protocols.plc.codes import DriftState, PlcCommand
from protocols.plc.results import CommandResult


@dataclass(frozen=True)
class RegistersWritten:
    """`writer` wrote to the control block; `words` are all writable registers from address 0 on, after the write.

    In them ABORT is the writer's own: several writers hold it independently.
    """

    words: tuple[int, ...]
    writer: str = ""


@dataclass(frozen=True)
class StartAccepted:
    """The daemon has begun the requested command."""


@dataclass(frozen=True)
class StartRefused:
    """The daemon refused the requested command."""

    error_code: int


@dataclass(frozen=True)
class StationReached:
    """Progress of the command."""

    station: int
    stations: int


@dataclass(frozen=True)
class CommandEnded:
    result: CommandResult


@dataclass(frozen=True)
class CellStatus:
    """State of the cell for the PLC's status registers. `ready`: the daemon could start a command now.

    `stop_unconfirmed`: the controller has not confirmed that the arm is stopped and disarmed.
    """

    ready: bool
    in_force: bool = False
    calibration_age_s: int = 0
    drift: DriftState = DriftState.OFF
    drift_shift_um: int = 0
    stop_unconfirmed: bool = False


@dataclass(frozen=True)
class TimePassed:
    """Time that has passed since the last one."""

    seconds: float


HandshakeEvent = (
    RegistersWritten | StartAccepted | StartRefused | StationReached | CommandEnded | CellStatus | TimePassed
)


@dataclass(frozen=True)
class StartCommand:
    """Begin a command; report back with StartAccepted or StartRefused. 0 wanted: as in the settings."""

    command: PlcCommand
    stations_wanted: int
    part_id: int
    tolerance_um: int = 0
    camera: int = 0


@dataclass(frozen=True)
class AbortRun:
    """Abort the run in progress, whoever started it."""

    why: str


Effect = StartCommand | AbortRun
