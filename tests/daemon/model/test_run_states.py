"""What a run may do next: every state with every event."""

from itertools import product

import pytest

from daemon.model.run_states import FINAL_STATES, NEXT_STATE, IllegalEvent, RunEvent, RunState, next_state

S, E = RunState, RunEvent

LEGAL = {
    (S.MOVING, E.ARRIVED): S.SETTLING,
    (S.MOVING, E.STANDS): S.FINISHED,
    (S.SETTLING, E.SETTLED): S.CAPTURING,
    (S.CAPTURING, E.CAPTURED): S.MOVING,
    (S.CAPTURING, E.LOOKED): S.PLANNING,
    (S.PLANNING, E.PLANNED): S.MOVING,
    (S.PLANNING, E.ENOUGH): S.DETECTING,
    (S.WAITING, E.ASKED): S.SETTLING,
    (S.WAITING, E.ENOUGH): S.DETECTING,
    (S.PLANNING, E.ADVISED): S.WAITING,
    (S.WAITING, E.JOGS): S.MOVING,
    (S.MOVING, E.JOGGED): S.WAITING,
    **{(state, E.REFUSED): S.WAITING for state in (S.MOVING, S.SETTLING, S.CAPTURING, S.PLANNING)},
    (S.CAPTURING, E.ALL_CAPTURED): S.DETECTING,
    (S.CAPTURING, E.ALL_STORED): S.FINISHED,
    (S.DETECTING, E.DETECTED): S.SOLVING,
    (S.SOLVING, E.SOLVED): S.FINISHED,
    **{(state, E.FAULT): S.FAILED for state in S if state not in {S.FINISHED, S.FAILED, S.ABORTED}},
    **{(state, E.ABORT): S.ABORTED for state in S if state not in {S.FINISHED, S.FAILED, S.ABORTED}},
}


@pytest.mark.parametrize(("state", "event"), list(product(RunState, RunEvent)))
def test_every_state_with_every_event(state: RunState, event: RunEvent) -> None:
    if (state, event) in LEGAL:
        assert next_state(state, event) is LEGAL[state, event]
    else:
        with pytest.raises(IllegalEvent, match=f"{state} cannot take the event {event}"):
            next_state(state, event)


def test_every_state_has_a_row_and_can_be_reached() -> None:
    reached = {RunState.MOVING} | {after for row in NEXT_STATE.values() for after in row.values()}
    assert set(NEXT_STATE) == set(RunState) == reached


def test_a_run_that_is_over_stays_over() -> None:
    assert {S.FINISHED, S.FAILED, S.ABORTED} == FINAL_STATES
