"""State machine of the handshake with a PLC: events in, states and effects out.

Triggers act on their rising edge, and only after all of them have been seen low once since the daemon started, so that
a trigger held over a restart moves nothing. A result block is written before RESULTS_VALID rises and stays unchanged
until it is acknowledged; before that no trigger starts anything, so that a flickering one starts one run a result.
ABORT acts on its rising edge, and as a level keeps everybody from starting: each writer holds its own.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

from protocols.counter import next_count
from protocols.modbus.words import WordOrder, Words, unsigned_of
from protocols.plc.codes import (
    MAP_VERSION,
    NO_ERROR,
    TRIGGER_BITS,
    TRIGGERS,
    ControlBit,
    DriftState,
    PlcCommand,
    StatusBit,
    number_of,
)
from protocols.plc.events import (
    AbortRun,
    CellStatus,
    CommandEnded,
    Effect,
    HandshakeEvent,
    RegistersWritten,
    StartAccepted,
    StartCommand,
    StartRefused,
    StationReached,
    TimePassed,
)
from protocols.plc.registers import BY_NAME, REGISTERS, RESULT, STATUS, WRITABLE
from protocols.plc.results import NO_RESULT, Value, encode_block, result_block


class Phase(Enum):
    """Phase of the PLC's command."""

    IDLE = "idle"
    STARTING = "starting"
    RUNNING = "running"


NEXT_PHASE: dict[Phase, dict[type[Any], Phase]] = {
    Phase.IDLE: {StartCommand: Phase.STARTING},
    Phase.STARTING: {StartAccepted: Phase.RUNNING, StartRefused: Phase.IDLE},
    Phase.RUNNING: {StationReached: Phase.RUNNING, CommandEnded: Phase.IDLE},
}
"""Every transition of the phase; StartCommand is an accepted trigger."""


class IllegalHandshakeEvent(Exception):
    """An event that NEXT_PHASE does not allow: a defect of the daemon, never of the PLC."""


@dataclass(frozen=True)
class Rules:
    """Settings of the handshake. `silence_s` None: the PLC's heartbeat is not monitored."""

    order: WordOrder = WordOrder.HIGH_FIRST
    motion_allowed: bool = False
    silence_s: float | None = None


@dataclass(frozen=True)
class Handshake:
    """Everything the PLC reads, and the state needed to derive it."""

    rules: Rules = Rules()
    written: Words = (0,) * len(WRITABLE)
    armed: bool = False
    phase: Phase = Phase.IDLE
    command: PlcCommand = PlcCommand.NONE
    answered: bool = False
    abort_wanted: bool = False
    missed: bool = False
    completed: bool = False
    error_code: int = NO_ERROR
    acquisition_id: int = 0
    result_id: int = 0
    part_id: int = 0
    station: int = 0
    stations: int = 0
    shown: Words = NO_RESULT
    valid: bool = False
    waiting: Words | None = None
    abort_writers: frozenset[str] = frozenset()
    cell: CellStatus | None = None
    heartbeat_out: int = 0
    silent_s: float = 0.0

    @property
    def control(self) -> ControlBit:
        return ControlBit(self.written[0])

    @property
    def silent(self) -> bool:
        """Whether the PLC's heartbeat is monitored and has stopped."""
        return self.rules.silence_s is not None and self.silent_s > self.rules.silence_s

    @property
    def ready(self) -> bool:
        """Whether a trigger rising now would be accepted, as far as is known."""
        could = self.cell is not None and self.cell.ready and self.rules.motion_allowed and not self.silent
        free = self.phase is Phase.IDLE and not self.result_pending and not self.abort_writers
        return could and self.armed and free and not self.control & TRIGGER_BITS

    @property
    def result_pending(self) -> bool:
        """Whether the last result has not been acknowledged."""
        return self.valid or self.waiting is not None

    def written_by(self, writer: str) -> Words:
        """The writable registers as that writer left them: ABORT is its own."""
        abort = ControlBit.ABORT if writer in self.abort_writers else ControlBit(0)
        return (int(self.control & ~ControlBit.ABORT | abort), *self.written[1:])

    def input(self, name: str) -> int:
        register = BY_NAME[name]
        words = self.written[register.address : register.address + register.registers]
        return words[0] if len(words) == 1 else unsigned_of(words, self.rules.order)


@dataclass(frozen=True)
class Reaction:
    """The states to show in turn, the last of which stays, and the effects to carry out."""

    states: tuple[Handshake, ...]
    effects: tuple[Effect, ...] = ()

    @property
    def state(self) -> Handshake:
        return self.states[-1]


def react(state: Handshake, event: HandshakeEvent) -> Reaction:
    """Process an event. Raises IllegalHandshakeEvent."""
    after, effects = _REACTIONS[type(event)](state, event)
    return Reaction(_show_next_result(after), effects)


Change = tuple[Handshake, tuple[Effect, ...]]


def _on_write(state: Handshake, event: RegistersWritten) -> Change:
    own = ControlBit(event.words[0])
    rising = own & ~ControlBit(state.written_by(event.writer)[0])
    holders = state.abort_writers | {event.writer} if own & ControlBit.ABORT else state.abort_writers - {event.writer}
    control = own & ~ControlBit.ABORT | (ControlBit.ABORT if holders else ControlBit(0))
    beat = event.words[BY_NAME["heartbeat_in"].address] != state.input("heartbeat_in")
    effects: tuple[Effect, ...] = ()
    written = (int(control), *event.words[1:])
    silent_s = 0.0 if beat else state.silent_s
    after = replace(state, written=written, abort_writers=holders, silent_s=silent_s)
    if rising & ControlBit.CLEAR_ERROR:
        after = replace(after, error_code=NO_ERROR, missed=False)
    if rising & ControlBit.RESULTS_ACK:
        after = replace(after, valid=False)
    if rising & ControlBit.ABORT:
        after, effects = _abort(after, "the PLC")
    if after.armed and rising & TRIGGER_BITS:
        after, more = _on_trigger(after, rising)
        return after, (*effects, *more)
    if not after.control & TRIGGER_BITS:
        after = replace(after, armed=True, answered=False)
    return after, effects


def _on_trigger(state: Handshake, rising: ControlBit) -> Change:
    """Process rising triggers: start the command, or refuse it with an error code."""
    refusal = _refusal_code(state, rising)
    if refusal:
        missed = state.phase is not Phase.IDLE
        return replace(state, error_code=number_of(refusal), missed=missed or state.missed, answered=True), ()
    command = TRIGGERS[rising & TRIGGER_BITS]
    part_id = state.input("part_id")
    after = replace(
        state,
        phase=_next_phase(state, StartCommand),
        command=command,
        part_id=part_id,
        completed=False,
        missed=False,
        error_code=NO_ERROR,
        answered=False,
        station=0,
        stations=0,
    )
    wanted, tolerance_um = state.input("stations_wanted"), state.input("tolerance_wanted")
    return after, (StartCommand(command, wanted, part_id, tolerance_um, state.input("camera_wanted")),)


def _refusal_code(state: Handshake, rising: ControlBit) -> str:
    """Error code that refuses a trigger without asking the daemon; empty when it may start."""
    checks = (
        (bool(state.control & ControlBit.ABORT), "aborted"),
        (rising & TRIGGER_BITS not in TRIGGERS, "plc-trigger-ambiguous"),
        (state.phase is not Phase.IDLE, "run-in-progress"),
        (not state.rules.motion_allowed, "plc-motion-not-allowed"),
        (state.silent, "plc-silent"),
        (state.cell is None, "plc-not-online"),
        (state.result_pending, "plc-result-pending"),
    )
    return next((code for hit, code in checks if hit), "")


def _abort(state: Handshake, why: str) -> Change:
    """Abort now, or as soon as the command being started has begun."""
    if state.phase is Phase.STARTING:
        return replace(state, abort_wanted=True), ()
    return state, (AbortRun(why),)


def _on_acceptance(state: Handshake, _event: StartAccepted) -> Change:
    after = replace(
        state,
        phase=_next_phase(state, StartAccepted),
        acquisition_id=next_count(state.acquisition_id),
        answered=bool(state.control & TRIGGER_BITS),
        abort_wanted=False,
    )
    return after, (AbortRun("the PLC"),) if state.abort_wanted else ()


def _on_refusal(state: Handshake, event: StartRefused) -> Change:
    answered = bool(state.control & TRIGGER_BITS)
    phase = _next_phase(state, StartRefused)
    return replace(state, phase=phase, error_code=event.error_code, answered=answered, abort_wanted=False), ()


def _on_progress(state: Handshake, event: StationReached) -> Change:
    phase = _next_phase(state, StationReached)
    return replace(state, phase=phase, station=event.station, stations=event.stations), ()


def _on_end(state: Handshake, event: CommandEnded) -> Change:
    number = next_count(state.result_id)
    block = result_block(event.result, number, state.acquisition_id, state.part_id, state.rules.order)
    after = replace(
        state,
        phase=_next_phase(state, CommandEnded),
        result_id=number,
        completed=True,
        error_code=event.result.error_code or state.error_code,
    )
    return replace(after, waiting=block), ()


def _on_time(state: Handshake, event: TimePassed) -> Change:
    after = replace(
        state, heartbeat_out=next_count(state.heartbeat_out), silent_s=min(state.silent_s + event.seconds, 1e6)
    )
    if not after.silent or state.silent:
        return after, ()
    after = replace(after, error_code=number_of("plc-silent"))
    return (after, ()) if after.phase is Phase.IDLE else _abort(after, "the PLC's silence")


def _show_next_result(state: Handshake) -> tuple[Handshake, ...]:
    """Show the result once results_ack is low: first its block, then RESULTS_VALID."""
    if state.valid or state.waiting is None or state.control & ControlBit.RESULTS_ACK:
        return (state,)
    laid_out = replace(state, shown=state.waiting, waiting=None)
    return laid_out, replace(laid_out, valid=True)


def _next_phase(state: Handshake, event: type[Any]) -> Phase:
    try:
        return NEXT_PHASE[state.phase][event]
    except KeyError:
        raise IllegalHandshakeEvent(f"{event.__name__} while the handshake is {state.phase.value}") from None


_REACTIONS: dict[type[Any], Callable[[Handshake, Any], Change]] = {
    RegistersWritten: _on_write,
    StartAccepted: _on_acceptance,
    StartRefused: _on_refusal,
    StationReached: _on_progress,
    CommandEnded: _on_end,
    CellStatus: lambda state, event: (replace(state, cell=event), ()),
    TimePassed: _on_time,
}


# The registers a PLC reads, from the state of the handshake.

STATUS_REGISTERS = tuple(register for register in REGISTERS if STATUS <= register.address < RESULT)

CONSTANT_FLOAT, CONSTANT_INT = 123.456, 123456

UNKNOWN_CELL = CellStatus(ready=False)


def register_image(state: Handshake) -> Words:
    """All registers from address 0 on."""
    status = encode_block(_values(state), STATUS_REGISTERS, STATUS, RESULT - STATUS, state.rules.order)
    return (*state.written, *(0,) * (STATUS - len(state.written)), *status, *state.shown)


def status_bits(state: Handshake) -> StatusBit:
    """Bits of the status register."""
    cell = state.cell or UNKNOWN_CELL
    bits = (
        (state.ready, StatusBit.READY),
        (state.answered, StatusBit.TRIGGER_ACK),
        (cell.in_force, StatusBit.CALIBRATION_IN_FORCE),
        (state.missed, StatusBit.MISSED_TRIGGER),
        (cell.drift is DriftState.DRIFTING, StatusBit.DRIFT_ALARM),
        (state.rules.motion_allowed, StatusBit.MOTION_ALLOWED),
        (state.silent, StatusBit.PLC_SILENT),
        (state.cell is not None, StatusBit.ONLINE),
        (state.phase is not Phase.IDLE, StatusBit.BUSY),
        (state.completed, StatusBit.COMPLETED),
        (state.valid, StatusBit.RESULTS_VALID),
        (cell.stop_unconfirmed, StatusBit.STOP_UNCONFIRMED),
        (bool(state.error_code), StatusBit.ERROR),
    )
    return StatusBit(sum(bit for hit, bit in bits if hit))


def _values(state: Handshake) -> dict[str, Value]:
    cell = state.cell or UNKNOWN_CELL
    return {
        "status": status_bits(state),
        "command": state.command,
        "error_code": state.error_code,
        "acquisition_id": state.acquisition_id,
        "result_id": state.result_id,
        "heartbeat_out": state.heartbeat_out,
        "heartbeat_echo": state.input("heartbeat_in"),
        "map_version": MAP_VERSION,
        "constant_float": CONSTANT_FLOAT,
        "constant_int": CONSTANT_INT,
        "station": state.station,
        "stations": state.stations,
        "calibration_age": cell.calibration_age_s,
        "results_waiting": int(state.waiting is not None),
        "drift_state": cell.drift,
        "drift_shift": cell.drift_shift_um,
    }
