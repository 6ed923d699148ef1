"""What a run may do next. Whatever changes a run's state is a row here."""

from enum import StrEnum


class RunState(StrEnum):
    """Where a run stands."""

    MOVING = "moving"
    WAITING = "waiting"  # for the operator, who jogs
    SETTLING = "settling"
    CAPTURING = "capturing"
    PLANNING = "planning"
    DETECTING = "detecting"
    SOLVING = "solving"
    FINISHED = "finished"
    FAILED = "failed"
    ABORTED = "aborted"


class RunEvent(StrEnum):
    """What happens to a run."""

    ARRIVED = "arrived"
    ASKED = "asked"  # by the operator, for a view from where the arm stands
    REFUSED = "refused"  # that view; the operator is told why, and the run goes on waiting
    ADVISED = "advised"  # the view is taken, and the operator told where to go next
    SETTLED = "settled"
    CAPTURED = "captured"  # and there is another station
    LOOKED = "looked"  # and where to go next depends on what was seen
    PLANNED = "planned"
    ENOUGH = "enough"  # what was seen determines X well enough, or as many views as asked for are taken
    ALL_CAPTURED = "all-captured"  # the arm has nothing more to do, the computer has
    ALL_STORED = "all-stored"  # a scan: nothing is left to do at all
    DETECTED = "detected"
    SOLVED = "solved"
    FAULT = "fault"
    ABORT = "abort"


class IllegalEvent(Exception):
    """An event that the table does not allow: a defect of the program, never of the cell."""

    def __init__(self, state: RunState, event: RunEvent) -> None:
        self.state, self.event = state, event
        super().__init__(f"a run that is {state} cannot take the event {event}")


S, E = RunState, RunEvent
_ENDS_BADLY = {E.FAULT: S.FAILED, E.ABORT: S.ABORTED}

NEXT_STATE: dict[RunState, dict[RunEvent, RunState]] = {
    S.MOVING: {E.ARRIVED: S.SETTLING, **_ENDS_BADLY},
    S.WAITING: {E.ASKED: S.SETTLING, E.ENOUGH: S.DETECTING, **_ENDS_BADLY},
    S.SETTLING: {E.SETTLED: S.CAPTURING, E.REFUSED: S.WAITING, **_ENDS_BADLY},
    S.CAPTURING: {
        E.REFUSED: S.WAITING,
        E.CAPTURED: S.MOVING,
        E.LOOKED: S.PLANNING,
        E.ALL_CAPTURED: S.DETECTING,
        E.ALL_STORED: S.FINISHED,
        **_ENDS_BADLY,
    },
    S.PLANNING: {
        E.PLANNED: S.MOVING,
        E.ENOUGH: S.DETECTING,
        E.ADVISED: S.WAITING,
        E.REFUSED: S.WAITING,
        **_ENDS_BADLY,
    },
    S.DETECTING: {E.DETECTED: S.SOLVING, **_ENDS_BADLY},
    S.SOLVING: {E.SOLVED: S.FINISHED, **_ENDS_BADLY},
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
