"""The states of a run, and which may follow which: every step is in a row of NEXT_STATES."""

from enum import StrEnum


class RunState(StrEnum):
    """The state of a run."""

    MOVING = "moving"
    WAITING = "waiting"  # for the operator, who jogs the arm
    SETTLING = "settling"
    CAPTURING = "capturing"
    PLANNING = "planning"  # from what was seen
    DETECTING = "detecting"  # motion is complete, the computation begins
    SOLVING = "solving"
    FINISHED = "finished"
    FAILED = "failed"
    ABORTED = "aborted"


class IllegalStep(Exception):
    """A step that the table does not allow: a defect of the program."""

    def __init__(self, state: RunState, after: RunState) -> None:
        self.state, self.after = state, after
        super().__init__(f"a run that is {state} cannot be {after} next")


S = RunState
_ENDED_EARLY = {S.FAILED, S.ABORTED}

NEXT_STATES: dict[RunState, set[RunState]] = {
    S.MOVING: {S.SETTLING, S.WAITING, S.FINISHED, *_ENDED_EARLY},
    S.WAITING: {S.SETTLING, S.MOVING, S.DETECTING, *_ENDED_EARLY},
    S.SETTLING: {S.CAPTURING, S.WAITING, *_ENDED_EARLY},
    S.CAPTURING: {S.WAITING, S.MOVING, S.PLANNING, S.DETECTING, S.FINISHED, *_ENDED_EARLY},
    S.PLANNING: {S.MOVING, S.WAITING, S.DETECTING, *_ENDED_EARLY},
    S.DETECTING: {S.SOLVING, *_ENDED_EARLY},
    S.SOLVING: {S.FINISHED, *_ENDED_EARLY},
    S.FINISHED: set(),
    S.FAILED: set(),
    S.ABORTED: set(),
}

FINAL_STATES = frozenset(state for state, after in NEXT_STATES.items() if not after)


def require_step(state: RunState, after: RunState) -> None:
    """Raises IllegalStep where a run in `state` cannot be `after` next."""
    if after not in NEXT_STATES[state]:
        raise IllegalStep(state, after)
