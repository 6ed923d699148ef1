"""When a move is over: reports of the controller as a table, at a tenth of a second each."""

import pytest

from drivers.errors import MoveFailed, MoveStalled
from drivers.robots.abb.cb_status_errors import MoveMonitor
from protocols.cb.codes import Flag, Status
from protocols.cb.messages import Report

OURS = 7


def report(progress_per_mille: int, flags: Flag = Flag.MOVING, finished: tuple[int, int] = (6, Status.OK)) -> Report:
    return Report(flags, *finished, progress_per_mille, 0)


def watched(*reports: tuple[Report, float]) -> bool:
    """Whether the arm stands at its goal after reports, each with its time."""
    arrival = MoveMonitor("robot", OURS)
    return [arrival.has_arrived(told, now_s) for told, now_s in reports][-1]


def test_a_move_is_over_when_its_number_is_named_and_no_flag_says_it_otherwise() -> None:
    assert not watched((report(1000, Flag.IN_POSITION), 0.0))
    assert watched((report(1000, Flag.MOVING, (OURS, Status.OK)), 0.0))


def test_a_slow_move_may_take_its_time() -> None:
    assert not watched(*((report(mille), 4.9 * mille) for mille in range(200)))


@pytest.mark.parametrize(
    ("told", "after_s", "error", "what"),
    [
        (report(0, finished=(OURS, Status.ESTOP)), 0.1, MoveFailed, "the emergency stop is pressed"),
        (report(0), 5.1, MoveStalled, "stood still for 5 s after 0 % of the way"),
        (report(437), 5.1, MoveStalled, "after 44 % of the way"),
        (report(1000), 5.1, MoveStalled, "does not come to rest"),
        (report(1000, Flag.AUTO), 5.1, MoveStalled, "does not come to rest"),
        (report(1000, Flag.IN_POSITION), 2.1, MoveFailed, "does not know move 7 any more"),
    ],
)
def test_how_a_move_ends_badly(told: Report, after_s: float, error: type[MoveFailed], what: str) -> None:
    before = report(told.progress_per_mille, Flag(told.flags))
    with pytest.raises(error, match=what) as raised:
        watched((before, 0.0), (told, after_s))
    assert type(raised.value) is error
