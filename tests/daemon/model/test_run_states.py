"""What a run may be next: every state after every state."""

from itertools import product

import pytest

from daemon.model.run_states import FINAL_STATES, NEXT_STATES, IllegalStep, RunState, require_step

S = RunState
ENDED = {S.FINISHED, S.FAILED, S.ABORTED}

LEGAL = {
    (S.MOVING, S.SETTLING),  # the arm has arrived
    (S.MOVING, S.FINISHED),  # a jog: the arm stands
    (S.MOVING, S.WAITING),  # of a run by hand: it stands, or the jog was refused
    (S.SETTLING, S.CAPTURING),
    (S.SETTLING, S.WAITING),
    (S.CAPTURING, S.MOVING),
    (S.CAPTURING, S.PLANNING),
    (S.CAPTURING, S.DETECTING),
    (S.CAPTURING, S.FINISHED),  # a scan: its last cloud is stored
    (S.CAPTURING, S.WAITING),
    (S.PLANNING, S.MOVING),
    (S.PLANNING, S.DETECTING),
    (S.PLANNING, S.WAITING),
    (S.WAITING, S.SETTLING),
    (S.WAITING, S.MOVING),
    (S.WAITING, S.DETECTING),
    (S.DETECTING, S.SOLVING),
    (S.SOLVING, S.FINISHED),
    *product(set(S) - ENDED, (S.FAILED, S.ABORTED)),
}


@pytest.mark.parametrize(("state", "after"), list(product(RunState, RunState)))
def test_every_state_after_every_state(state: RunState, after: RunState) -> None:
    if (state, after) in LEGAL:
        require_step(state, after)
    else:
        with pytest.raises(IllegalStep, match=f"{state} cannot be {after} next"):
            require_step(state, after)


def test_every_state_has_a_row_and_can_be_reached() -> None:
    assert set(NEXT_STATES) == set(RunState) == {RunState.MOVING}.union(*NEXT_STATES.values())


def test_a_run_that_is_over_stays_over() -> None:
    assert ENDED == FINAL_STATES
