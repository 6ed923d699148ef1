"""The handshake with a PLC: events in, states and effects out. Its image is `protocols.plc.image`.

Triggers act on their rising edge, and only after this daemon has once seen all of them low: a PLC that still holds
one from before a restart moves nothing. A result block is written before RESULTS_VALID rises, and stays as it is until
it is acknowledged; results that come meanwhile wait behind it, WAITING_MOST of them, then BUFFER_OVERRUN is set.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

from protocols.modbus.words import WordOrder, Words, unsigned_of
from protocols.plc.codes import TRIGGER_BITS, TRIGGERS, Command, Control
from protocols.plc.error_codes import NO_ERROR, number_of
from protocols.plc.events import (
    Abort,
    Accepted,
    Beat,
    CellSeen,
    Effect,
    Ended,
    Event,
    Progressed,
    Refused,
    Start,
    Written,
)
from protocols.plc.registers import BY_NAME, WRITABLE
from protocols.plc.results import NO_RESULT, result_block

WAITING_MOST = 4
"""Results behind the one shown."""

COUNT_MOST = 65535


class Phase(Enum):
    """Where the command of a PLC stands."""

    IDLE = "idle"
    STARTING = "starting"
    RUNNING = "running"


NEXT_PHASE: dict[Phase, dict[type[Any], Phase]] = {
    Phase.IDLE: {Start: Phase.STARTING},
    Phase.STARTING: {Accepted: Phase.RUNNING, Refused: Phase.IDLE},
    Phase.RUNNING: {Progressed: Phase.RUNNING, Ended: Phase.IDLE},
}
"""Whatever changes the phase is a row here; Start is what a trigger becomes when it may."""


class IllegalEvent(Exception):
    """An event that the table does not allow: a defect of the program, never of the PLC."""


@dataclass(frozen=True)
class Rules:
    """From the settings. `silence_s` None: the PLC's heartbeat is not watched."""

    order: WordOrder = WordOrder.HIGH_FIRST
    motion_allowed: bool = False
    silence_s: float | None = None


@dataclass(frozen=True)
class Handshake:
    """Everything the PLC is told, and what is remembered to tell it."""

    rules: Rules = Rules()
    written: Words = (0,) * len(WRITABLE)
    armed: bool = False
    phase: Phase = Phase.IDLE
    command: Command = Command.NONE
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
    waiting: tuple[Words, ...] = ()
    overrun: bool = False
    cell: CellSeen | None = None
    heartbeat_out: int = 0
    silent_s: float = 0.0

    @property
    def control(self) -> Control:
        return Control(self.written[0])

    @property
    def silent(self) -> bool:
        """The PLC's heartbeat is watched, and has stopped."""
        return self.rules.silence_s is not None and self.silent_s > self.rules.silence_s

    @property
    def ready(self) -> bool:
        """A trigger that rises now would be accepted, as far as is known."""
        could = self.cell is not None and self.cell.ready and self.rules.motion_allowed and not self.silent
        return could and self.armed and self.phase is Phase.IDLE and not self.control & TRIGGER_BITS

    def input(self, name: str) -> int:
        """A number the PLC wrote."""
        register = BY_NAME[name]
        words = self.written[register.address : register.address + register.registers]
        return words[0] if len(words) == 1 else unsigned_of(words, self.rules.order)


@dataclass(frozen=True)
class Reaction:
    """The states to show one after the other, and what to do. The last state is the one that stays."""

    states: tuple[Handshake, ...]
    effects: tuple[Effect, ...] = ()

    @property
    def state(self) -> Handshake:
        return self.states[-1]


def react(state: Handshake, event: Event) -> Reaction:
    """What becomes of `state`. Raises IllegalEvent."""
    after, effects = _REACTIONS[type(event)](state, event)
    return Reaction(_presented(after), effects)


def following(count: int) -> int:
    """1 to 65535, then 1 again: 0 means that nothing has happened yet."""
    return count % COUNT_MOST + 1


Change = tuple[Handshake, tuple[Effect, ...]]


def _written(state: Handshake, event: Written) -> Change:
    rising = Control(event.words[0]) & ~state.control
    beat = event.words[BY_NAME["heartbeat_in"].address] != state.input("heartbeat_in")
    effects: tuple[Effect, ...] = ()
    after = replace(state, written=event.words, silent_s=0.0 if beat else state.silent_s)
    if rising & Control.CLEAR_ERROR:
        after = replace(after, error_code=NO_ERROR, missed=False, overrun=False)
    if rising & Control.RESULTS_ACK:
        after = replace(after, valid=False)
    if rising & Control.ABORT:
        after, effects = _aborting(after, "the PLC")
    if after.armed and rising & TRIGGER_BITS:
        after, more = _triggered(after, rising)
        return after, (*effects, *more)
    if not after.control & TRIGGER_BITS:
        after = replace(after, armed=True, answered=False)
    return after, effects


def _triggered(state: Handshake, rising: Control) -> Change:
    """A rising edge: begun, or refused with the reason."""
    refusal = _refusal(state, rising)
    if refusal:
        missed = state.phase is not Phase.IDLE
        return replace(state, error_code=number_of(refusal), missed=missed or state.missed, answered=True), ()
    command = TRIGGERS[rising & TRIGGER_BITS]
    part_id = state.input("part_id")
    after = replace(
        state,
        phase=_next_phase(state, Start),
        command=command,
        part_id=part_id,
        completed=False,
        missed=False,
        error_code=NO_ERROR,
        answered=False,
        station=0,
        stations=0,
    )
    return after, (Start(command, state.input("stations_wanted"), part_id),)


def _refusal(state: Handshake, rising: Control) -> str:
    """Why a trigger is refused without asking the daemon; empty when it is not."""
    checks = (
        (bool(state.control & Control.ABORT), "aborted"),
        (rising & TRIGGER_BITS not in TRIGGERS, "plc-trigger-ambiguous"),
        (state.phase is not Phase.IDLE, "run-in-progress"),
        (not state.rules.motion_allowed, "plc-motion-not-allowed"),
        (state.silent, "plc-silent"),
        (state.cell is None, "plc-not-online"),
    )
    return next((code for hit, code in checks if hit), "")


def _aborting(state: Handshake, why: str) -> Change:
    """Stop now, or as soon as what is being started has begun."""
    if state.phase is Phase.STARTING:
        return replace(state, abort_wanted=True), ()
    return state, (Abort(why),)


def _accepted(state: Handshake, _event: Accepted) -> Change:
    after = replace(
        state,
        phase=_next_phase(state, Accepted),
        acquisition_id=following(state.acquisition_id),
        answered=bool(state.control & TRIGGER_BITS),
        abort_wanted=False,
    )
    return after, (Abort("the PLC"),) if state.abort_wanted else ()


def _refused(state: Handshake, event: Refused) -> Change:
    answered = bool(state.control & TRIGGER_BITS)
    phase = _next_phase(state, Refused)
    return replace(state, phase=phase, error_code=event.error_code, answered=answered, abort_wanted=False), ()


def _progressed(state: Handshake, event: Progressed) -> Change:
    phase = _next_phase(state, Progressed)
    return replace(state, phase=phase, station=event.station, stations=event.stations), ()


def _ended(state: Handshake, event: Ended) -> Change:
    number = following(state.result_id)
    block = result_block(event.result, number, state.acquisition_id, state.part_id, state.rules.order)
    after = replace(
        state,
        phase=_next_phase(state, Ended),
        result_id=number,
        completed=True,
        error_code=event.result.error_code or state.error_code,
    )
    if len(state.waiting) >= WAITING_MOST:
        return replace(after, overrun=True), ()
    return replace(after, waiting=(*state.waiting, block)), ()


def _cell_seen(state: Handshake, event: CellSeen) -> Change:
    return replace(state, cell=event), ()


def _beaten(state: Handshake, event: Beat) -> Change:
    after = replace(
        state, heartbeat_out=following(state.heartbeat_out), silent_s=min(state.silent_s + event.seconds, 1e6)
    )
    if not after.silent or state.silent:
        return after, ()
    after = replace(after, error_code=number_of("plc-silent"))
    return (after, ()) if after.phase is Phase.IDLE else _aborting(after, "the PLC's silence")


def _presented(state: Handshake) -> tuple[Handshake, ...]:
    """The next result when the PLC is done with the last: first its block, then the bit that says it is there."""
    if state.valid or not state.waiting or state.control & Control.RESULTS_ACK:
        return (state,)
    block, *behind = state.waiting
    laid_out = replace(state, shown=block, waiting=tuple(behind))
    return laid_out, replace(laid_out, valid=True)


def _next_phase(state: Handshake, event: type[Any]) -> Phase:
    try:
        return NEXT_PHASE[state.phase][event]
    except KeyError:
        raise IllegalEvent(f"{event.__name__} while the handshake is {state.phase.value}") from None


_REACTIONS: dict[type[Any], Callable[[Handshake, Any], Change]] = {
    Written: _written,
    Accepted: _accepted,
    Refused: _refused,
    Progressed: _progressed,
    Ended: _ended,
    CellSeen: _cell_seen,
    Beat: _beaten,
}
