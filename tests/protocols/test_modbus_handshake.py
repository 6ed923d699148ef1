"""The handshake with a PLC: a table of stories, then whatever order hypothesis thinks of."""

from dataclasses import replace

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from protocols.counter import next_count
from protocols.modbus.words import crc16
from protocols.plc.codes import (
    TRIGGER_BITS,
    TRIGGERS,
    ControlBit,
    DriftState,
    PlcCommand,
    PlcVerdict,
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
from protocols.plc.handshake import (
    NEXT_PHASE,
    Handshake,
    IllegalHandshakeEvent,
    Phase,
    Rules,
    react,
    register_image,
    status_bits,
)
from protocols.plc.registers import BY_NAME, RESULT
from protocols.plc.results import NO_RESULT, CommandResult

C, S = ControlBit, StatusBit
MOVING = Rules(motion_allowed=True)
SEEN = CellStatus(ready=True, in_force=True)


def control(
    word: int,
    stations: int = 0,
    part: int = 0,
    beat: int = 0,
    writer: str = "",
    tolerance_um: int = 0,
    camera: int = 0,
) -> RegistersWritten:
    return RegistersWritten((word, beat, stations, part >> 16, part & 0xFFFF, tolerance_um, camera), writer)


def ended(verdict: PlcVerdict = PlcVerdict.ACCEPTED, error: int = 0) -> CommandEnded:
    return CommandEnded(CommandResult(PlcCommand.VERIFY, verdict, "run", error))


def after(*events: HandshakeEvent, rules: Rules = MOVING) -> tuple[Handshake, list[Effect]]:
    state, effects = Handshake(rules), []
    for event in events:
        reaction = react(state, event)
        state = reaction.state
        effects += reaction.effects
    return state, effects


READY = (SEEN, control(0))
RUNNING = (*READY, control(C.TRIGGER_VERIFY), StartAccepted())
DONE = (*RUNNING, control(0), ended())
VERIFY = StartCommand(PlcCommand.VERIFY, 0, 0)
CALIBRATE_8 = StartCommand(PlcCommand.CALIBRATE, 8, 70000)

STORIES: dict[str, tuple[tuple[HandshakeEvent, ...], StatusBit, list[Effect], int]] = {
    "nothing yet": ((), S.MOTION_ALLOWED, [], 0),
    "the cell was seen, the PLC not": ((SEEN,), S.ONLINE, [], 0),
    "ready": (READY, S.ONLINE | S.READY, [], 0),
    "a trigger held since before the start moves nothing": ((SEEN, control(C.TRIGGER_VERIFY)), S.ONLINE, [], 0),
    "nor does it when it is written again": (
        (SEEN, control(C.TRIGGER_VERIFY), control(C.TRIGGER_VERIFY)), S.ONLINE, [], 0),
    "let go and set again it does": (
        (SEEN, control(C.TRIGGER_VERIFY), control(0), control(C.TRIGGER_VERIFY)), S.ONLINE | S.BUSY, [VERIFY], 0),
    "a trigger is asked for": ((*READY, control(C.TRIGGER_VERIFY)), S.ONLINE | S.BUSY, [VERIFY], 0),
    "with stations and part": (
        (*READY, control(C.TRIGGER_CALIBRATE, 8, 70000)), S.ONLINE | S.BUSY, [CALIBRATE_8], 0),
    "with a tolerance": (
        (*READY, control(C.TRIGGER_CALIBRATE, tolerance_um=300)), S.ONLINE | S.BUSY,
        [StartCommand(PlcCommand.CALIBRATE, 0, 0, 300)], 0),
    "accepted": (RUNNING, S.ONLINE | S.BUSY | S.TRIGGER_ACK, [VERIFY], 0),
    "the trigger goes, and so does its ack": ((*RUNNING, control(0)), S.ONLINE | S.BUSY, [VERIFY], 0),
    "a pulse that is gone before it is accepted leaves no ack, but its number": (
        (*READY, control(C.TRIGGER_VERIFY), control(0), StartAccepted()), S.ONLINE | S.BUSY, [VERIFY], 0),
    "refused by the daemon": (
        (*READY, control(C.TRIGGER_VERIFY), StartRefused(12)), S.ONLINE | S.TRIGGER_ACK | S.ERROR, [VERIFY], 12),
    "the error stays when the trigger goes": (
        (*READY, control(C.TRIGGER_VERIFY), StartRefused(12), control(0)), S.ONLINE | S.READY | S.ERROR, [VERIFY], 12),
    "until it is cleared": (
        (*READY, control(C.TRIGGER_VERIFY), StartRefused(12), control(0), control(C.CLEAR_ERROR)),
        S.ONLINE | S.READY, [VERIFY], 0),
    "or until the next trigger": (
        (*READY, control(C.TRIGGER_VERIFY), StartRefused(12), control(0), control(C.TRIGGER_VERIFY)),
        S.ONLINE | S.BUSY, [VERIFY, VERIFY], 0),
    "two triggers at once are none": (
        (*READY, control(C.TRIGGER_VERIFY | C.TRIGGER_REGISTER)), S.ONLINE | S.TRIGGER_ACK | S.ERROR, [], 1),
    "a trigger and an abort at once are an abort": (
        (*READY, control(C.TRIGGER_VERIFY | C.ABORT)), S.ONLINE | S.TRIGGER_ACK | S.ERROR, [AbortRun("the PLC")], 23),
    "a second trigger meanwhile is missed": (
        (*RUNNING, control(0), control(C.TRIGGER_CALIBRATE)),
        S.ONLINE | S.BUSY | S.TRIGGER_ACK | S.MISSED_TRIGGER | S.ERROR, [VERIFY], 10),
    "done": (DONE, S.ONLINE | S.COMPLETED | S.RESULTS_VALID, [VERIFY], 0),
    "done with the trigger still held": (
        (*RUNNING, ended()), S.ONLINE | S.TRIGGER_ACK | S.COMPLETED | S.RESULTS_VALID, [VERIFY], 0),
    "failed": (
        (*RUNNING, control(0), ended(PlcVerdict.FAILED, 30)),
        S.ONLINE | S.COMPLETED | S.RESULTS_VALID | S.ERROR, [VERIFY], 30),
    "a trigger before the result is acknowledged starts nothing": (
        (*DONE, control(C.TRIGGER_VERIFY)),
        S.ONLINE | S.TRIGGER_ACK | S.COMPLETED | S.RESULTS_VALID | S.ERROR, [VERIFY], 5),
    "nor does one that flickers": (
        (*DONE, *5 * (control(C.TRIGGER_VERIFY), control(0))),
        S.ONLINE | S.COMPLETED | S.RESULTS_VALID | S.ERROR, [VERIFY], 5),
    "nor one before the result of a held ack is shown": (
        (*RUNNING, control(C.RESULTS_ACK), ended(), control(C.RESULTS_ACK | C.TRIGGER_VERIFY)),
        S.ONLINE | S.TRIGGER_ACK | S.COMPLETED | S.ERROR, [VERIFY], 5),
    "after the acknowledgement it does": (
        (*DONE, control(C.RESULTS_ACK), control(0), control(C.TRIGGER_VERIFY)), S.ONLINE | S.BUSY, [VERIFY, VERIFY], 0),
    "acknowledged": ((*DONE, control(C.RESULTS_ACK)), S.ONLINE | S.READY | S.COMPLETED, [VERIFY], 0),
    "abort": ((*RUNNING, control(C.ABORT)), S.ONLINE | S.BUSY, [VERIFY, AbortRun("the PLC")], 0),
    "abort while it is being started is remembered": (
        (*READY, control(C.TRIGGER_VERIFY), control(C.ABORT), StartAccepted()),
        S.ONLINE | S.BUSY, [VERIFY, AbortRun("the PLC")], 0),
    "and forgotten when it is refused": (
        (*READY, control(C.TRIGGER_VERIFY), control(C.ABORT), StartRefused(12), control(0), control(C.TRIGGER_VERIFY),
         StartAccepted()), S.ONLINE | S.BUSY | S.TRIGGER_ACK, [VERIFY, VERIFY], 0),
    "abort when nothing of ours runs still goes out": (
        (*READY, control(C.ABORT)), S.ONLINE, [AbortRun("the PLC")], 0),
    "a trigger while abort is held starts nothing": (
        (*READY, control(C.ABORT), control(C.ABORT | C.TRIGGER_VERIFY)),
        S.ONLINE | S.TRIGGER_ACK | S.ERROR, [AbortRun("the PLC")], 23),
    "nor while another writer holds it": (
        (*READY, control(C.ABORT, writer="other"), control(C.TRIGGER_VERIFY)),
        S.ONLINE | S.TRIGGER_ACK | S.ERROR, [AbortRun("the PLC")], 23),
    "which only that one ends": (
        (*READY, control(C.ABORT, writer="other"), control(0), control(0, writer="other"), control(C.TRIGGER_VERIFY)),
        S.ONLINE | S.BUSY, [AbortRun("the PLC"), VERIFY], 0),
    "abort by two writers is two aborts": (
        (*READY, control(C.ABORT, writer="other"), control(C.ABORT)), S.ONLINE, 2 * [AbortRun("the PLC")], 0),
    "drift": (
        (replace(SEEN, drift=DriftState.DRIFTING), control(0)), S.ONLINE | S.READY | S.DRIFT_ALARM, [], 0),
    "the cell is not ready": ((replace(SEEN, ready=False), control(0)), S.ONLINE, [], 0),
}  # fmt: skip


@pytest.mark.parametrize(("events", "status", "effects", "error"), STORIES.values(), ids=STORIES.keys())
def test_stories(events: tuple[HandshakeEvent, ...], status: StatusBit, effects: list[Effect], error: int) -> None:
    state, done = after(*events)
    in_force = S.CALIBRATION_IN_FORCE if state.cell else S(0)
    assert status_bits(state) == status | S.MOTION_ALLOWED | in_force
    assert done == effects
    assert state.error_code == error


@pytest.mark.parametrize("command", TRIGGERS)
def test_without_the_settings_word_no_trigger_moves_anything(command: ControlBit) -> None:
    state, effects = after(*READY, control(command), rules=Rules(motion_allowed=False))
    assert effects == []
    assert state.error_code == number_of("plc-motion-not-allowed")
    assert not status_bits(state) & (S.READY | S.MOTION_ALLOWED | S.BUSY)


def test_a_trigger_before_the_cell_was_seen_is_refused() -> None:
    state, effects = after(control(0), control(C.TRIGGER_VERIFY))
    assert (effects, state.error_code) == ([], number_of("plc-not-online"))


def test_the_block_is_written_before_it_is_valid() -> None:
    state, _ = after(*RUNNING, control(0))
    reaction = react(state, ended())
    first, last = (register_image(shown) for shown in reaction.states)
    assert first[RESULT:] == last[RESULT:] != NO_RESULT
    assert not first[16] & S.RESULTS_VALID
    assert last[16] & S.RESULTS_VALID


def test_the_writers_of_abort_each_read_back_their_own() -> None:
    state, _ = after(*READY, control(C.ABORT, writer="gate"), control(C.CLEAR_ERROR, writer="panel"))
    assert [state.written_by(writer)[0] for writer in ("gate", "panel", "else")] == [
        C.CLEAR_ERROR | C.ABORT, C.CLEAR_ERROR, C.CLEAR_ERROR
    ]  # fmt: skip
    assert register_image(state)[0] == C.CLEAR_ERROR | C.ABORT


def test_a_result_that_comes_while_the_ack_is_held_waits_for_it() -> None:
    state, _ = after(*RUNNING, control(C.RESULTS_ACK), ended())
    assert not state.valid
    assert react(state, control(0)).state.valid


def test_a_silent_plc_is_noticed_and_what_it_started_is_stopped() -> None:
    rules = replace(MOVING, silence_s=2.0)
    state, effects = after(*RUNNING, control(0, beat=1), TimePassed(1.5), TimePassed(0.6), TimePassed(5.0), rules=rules)
    assert effects == [VERIFY, AbortRun("the PLC's silence")]
    assert status_bits(state) & S.PLC_SILENT
    assert state.error_code == number_of("plc-silent")
    state = react(react(state, ended(PlcVerdict.ABORTED, 23)).state, control(C.TRIGGER_VERIFY, beat=1)).state
    assert (state.phase, state.error_code) == (Phase.IDLE, number_of("plc-silent"))
    state = react(react(state, control(C.RESULTS_ACK, beat=2)).state, control(0, beat=2)).state
    assert not status_bits(state) & S.PLC_SILENT
    assert react(state, control(C.TRIGGER_VERIFY, beat=3)).effects == (VERIFY,)


def test_heartbeats_go_both_ways() -> None:
    state, _ = after(*READY, control(0, beat=77), TimePassed(0.5), TimePassed(0.5))
    image = register_image(state)
    assert image[BY_NAME["heartbeat_out"].address] == 2
    assert image[BY_NAME["heartbeat_echo"].address] == 77


def test_ids_count_from_one_and_never_show_zero_again() -> None:
    assert [next_count(0), next_count(1), next_count(65534), next_count(65535)] == [1, 2, 65535, 1]


@pytest.mark.parametrize("phase", Phase)
@pytest.mark.parametrize(
    "event", [StartAccepted(), StartRefused(1), StationReached(1, 2), ended()], ids=lambda e: type(e).__name__
)
def test_every_phase_with_every_event_of_the_daemon(phase: Phase, event: HandshakeEvent) -> None:
    state = Handshake(MOVING, phase=phase)
    if type(event) in NEXT_PHASE[phase]:
        assert react(state, event).state.phase is NEXT_PHASE[phase][type(event)]
    else:
        with pytest.raises(IllegalHandshakeEvent):
            react(state, event)


class AnyOrder(RuleBasedStateMachine):
    """A PLC that does anything, a daemon that answers what it is asked; what must hold, holds."""

    def __init__(self) -> None:
        super().__init__()
        self.state = Handshake(replace(MOVING, silence_s=3.0))
        self.asked: list[StartCommand] = []
        self.run = 0
        self.blocks: list[int] = []
        self.aborting: set[str] = set()

    def _take(self, event: HandshakeEvent) -> None:
        before = register_image(self.state)
        reaction = react(self.state, event)
        for shown in reaction.states:
            now = register_image(shown)
            valid_before, valid_now = before[16] & S.RESULTS_VALID, now[16] & S.RESULTS_VALID
            if now[RESULT:] != before[RESULT:]:
                assert not valid_before and not valid_now, "a block changed while it was valid, or became valid at once"
                self.blocks.append(now[RESULT])
            if valid_now:
                assert now[-1] == crc16(now[RESULT:-1])
            before = now
        self.state = reaction.state
        starts = [effect for effect in reaction.effects if isinstance(effect, StartCommand)]
        if starts:
            assert isinstance(event, RegistersWritten)
            assert event.words[0] & TRIGGER_BITS
        self.asked += starts

    @rule(
        word=st.integers(0, 63),
        beat=st.integers(0, 3),
        stations=st.integers(0, 65535),
        part=st.integers(0, 9),
        writer=st.sampled_from(["gate", "panel"]),
    )
    def writes(self, word: int, beat: int, stations: int, part: int, writer: str) -> None:
        old = self.state
        self._take(control(word, stations, part, beat, writer))
        self.aborting = self.aborting | {writer} if word & C.ABORT else self.aborting - {writer}
        if self.aborting or (old.result_pending and not word & ~old.control & C.RESULTS_ACK):
            assert len(self.asked) == (old.phase is Phase.STARTING)
        if old.phase is not Phase.IDLE or not (old.armed and C(word) & ~old.control & TRIGGER_BITS):
            assert len(self.asked) == (old.phase is Phase.STARTING)

    @rule(ready=st.booleans(), force=st.booleans())
    def sees_the_cell(self, ready: bool, force: bool) -> None:
        self._take(CellStatus(ready, force))

    @rule(seconds=st.floats(0, 4))
    def beats(self, seconds: float) -> None:
        self._take(TimePassed(seconds))

    @precondition(lambda self: self.state.phase is Phase.STARTING)
    @rule(accepted=st.booleans())
    def answers(self, accepted: bool) -> None:
        self.asked.pop()
        before = self.state.acquisition_id
        self._take(StartAccepted() if accepted else StartRefused(12))
        assert self.state.acquisition_id == (next_count(before) if accepted else before)

    @precondition(lambda self: self.state.phase is Phase.RUNNING)
    @rule(station=st.integers(0, 9))
    def goes_on(self, station: int) -> None:
        self._take(StationReached(station, 9))

    @precondition(lambda self: self.state.phase is Phase.RUNNING)
    @rule(verdict=st.sampled_from(PlcVerdict))
    def ends(self, verdict: PlcVerdict) -> None:
        self.run += 1
        self._take(ended(verdict, 0 if verdict is PlcVerdict.ACCEPTED else 30))
        assert self.state.result_id == self.run

    @invariant()
    def busy_is_busy(self) -> None:
        status = status_bits(self.state)
        assert bool(status & S.BUSY) == (self.state.phase is not Phase.IDLE)
        assert not (status & S.READY and status & S.BUSY)
        assert bool(status & S.ERROR) == bool(self.state.error_code)

    @invariant()
    def at_most_one_command_is_asked_for(self) -> None:
        assert len(self.asked) == (self.state.phase is Phase.STARTING)

    @invariant()
    def results_come_in_order_and_are_never_shown_twice(self) -> None:
        assert self.blocks == sorted(set(self.blocks))

    @invariant()
    def the_image_is_registers(self) -> None:
        assert all(0 <= word <= 0xFFFF for word in register_image(self.state))


TestAnyOrder = AnyOrder.TestCase
TestAnyOrder.settings = settings(max_examples=60, stateful_step_count=40, deadline=None)
