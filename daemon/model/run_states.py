"""State machine of a run: every transition is a row of NEXT_STATE."""

from enum import StrEnum


class RunState(StrEnum):
    """The state of a run."""

    MOVING = "moving"
    WAITING = "waiting"  # for the operator, who jogs the arm
    SETTLING = "settling"
    CAPTURING = "capturing"
    PLANNING = "planning"
    DETECTING = "detecting"
    SOLVING = "solving"
    FINISHED = "finished"
    FAILED = "failed"
    ABORTED = "aborted"


class RunEvent(StrEnum):
    ARRIVED = "arrived"
    ASKED = "asked"  # the operator asks for a view from the present pose
    JOGS = "jogs"  # the operator asks the daemon to jog the arm
    JOGGED = "jogged"  # the arm stands again, and the run goes on waiting
    REFUSED = "refused"  # that view or jog is refused with a reason, and the run goes on waiting
    ADVISED = "advised"  # the view is taken, and the operator has advice where to go next
    SETTLED = "settled"
    CAPTURED = "captured"  # and there is a next station
    LOOKED = "looked"  # and the next station is planned from what was seen
    PLANNED = "planned"
    ENOUGH = "enough"  # X is determined well enough, or the requested number of views is taken
    ALL_CAPTURED = "all-captured"  # motion is complete, the computation begins
    ALL_STORED = "all-stored"  # a scan: complete
    STANDS = "stands"  # a jog: complete
    DETECTED = "detected"
    SOLVED = "solved"
    FAULT = "fault"
    ABORT = "abort"


class IllegalEvent(Exception):
    """An event that the table does not allow: a defect of the program."""

    def __init__(self, state: RunState, event: RunEvent) -> None:
        self.state, self.event = state, event
        super().__init__(f"a run that is {state} cannot take the event {event}")


S, E = RunState, RunEvent
_FAILURES = {E.FAULT: S.FAILED, E.ABORT: S.ABORTED}

NEXT_STATE: dict[RunState, dict[RunEvent, RunState]] = {
    S.MOVING: {
        E.ARRIVED: S.SETTLING,
        E.STANDS: S.FINISHED,
        E.JOGGED: S.WAITING,
        E.REFUSED: S.WAITING,
        **_FAILURES,
    },
    S.WAITING: {E.ASKED: S.SETTLING, E.JOGS: S.MOVING, E.ENOUGH: S.DETECTING, **_FAILURES},
    S.SETTLING: {E.SETTLED: S.CAPTURING, E.REFUSED: S.WAITING, **_FAILURES},
    S.CAPTURING: {
        E.REFUSED: S.WAITING,
        E.CAPTURED: S.MOVING,
        E.LOOKED: S.PLANNING,
        E.ALL_CAPTURED: S.DETECTING,
        E.ALL_STORED: S.FINISHED,
        **_FAILURES,
    },
    S.PLANNING: {
        E.PLANNED: S.MOVING,
        E.ENOUGH: S.DETECTING,
        E.ADVISED: S.WAITING,
        E.REFUSED: S.WAITING,
        **_FAILURES,
    },
    S.DETECTING: {E.DETECTED: S.SOLVING, **_FAILURES},
    S.SOLVING: {E.SOLVED: S.FINISHED, **_FAILURES},
    S.FINISHED: {},
    S.FAILED: {},
    S.ABORTED: {},
}

FIRST_STATE = S.MOVING
FINAL_STATES = frozenset(state for state, row in NEXT_STATE.items() if not row)


def next_state(state: RunState, event: RunEvent) -> RunState:
    """The state after `event`. Raises IllegalEvent."""
    try:
        return NEXT_STATE[state][event]
    except KeyError:
        raise IllegalEvent(state, event) from None
