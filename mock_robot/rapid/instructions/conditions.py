"""Waiting for a condition that has no event of its own, with \\MaxTime and \\TimeFlag."""

from collections.abc import Callable

from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.tasks import ProgramTask

POLL_S = 0.02


def wait_for(
    task: ProgramTask,
    holds: Callable[[], bool],
    most_s: float | None = None,
    flag: Slot | None = None,
    poll_s: float = POLL_S,
) -> None:
    """Until it holds. After `most_s` the flag is set, or without one ERR_WAIT_MAXTIME raised; traps run meanwhile."""
    ends_s = None if most_s is None else task.now_s() + most_s
    if flag is not None:
        flag.value = False
    while not holds():
        if ends_s is not None and task.now_s() >= ends_s:
            if flag is None:
                raise RapidError("ERR_WAIT_MAXTIME", f"not within {most_s:g} s")
            flag.value = True
            return
        task.wait(poll_s if ends_s is None else min(poll_s, max(0.0, ends_s - task.now_s())))
