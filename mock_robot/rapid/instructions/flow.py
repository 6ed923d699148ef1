"""Waiting and ExitCycle. Traps run while an instruction waits.

WaitTime of the motion task runs on the arm's time, which may be scaled; all else is wire time.
"""

from collections.abc import Callable
from types import MappingProxyType
from typing import Any

from mock_robot.rapid.errors import CycleLeft, RapidError
from mock_robot.rapid.instructions.conditions import wait_for
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.tasks import ProgramTask
from mock_robot.rapid.values import single

POLL_S = 0.1
MIN_POLL_S = 0.04


def exit_cycle(task: ProgramTask) -> None:
    if task.motion:
        task.services.unit.clear()
    raise CycleLeft


def wait_time(task: ProgramTask, in_position: bool | None, seconds: float) -> None:
    """With \\InPos the time counts from standstill of the arm, but not before the instruction begins."""
    unit = task.services.unit
    if in_position:
        began_s = unit.now_s()
        while not unit.is_settled(seconds, began_s):
            task.wait(unit.settles_in_s(seconds, began_s))
    else:
        task.wait(seconds / (unit.time_scale if task.motion else 1.0))


def wait_until(
    task: ProgramTask,
    in_position: bool | None,
    condition: Callable[[], bool],
    max_time: float | None,
    time_flag: Slot | None,
    poll_rate: float | None,
    *shown: Any,
) -> None:
    """What the pendant shows meanwhile (\\Visualize) is left out."""
    poll_s = POLL_S if poll_rate is None else poll_rate
    if poll_s < single(MIN_POLL_S):
        raise RapidError("ERR_ARGVALERR", f"\\PollRate is {MIN_POLL_S} s at least")
    wait_for(task, condition, max_time, time_flag, poll_s)


def skip_warn(task: ProgramTask) -> None:
    """Keep the error that is being handled out of the event log."""
    if task.handled is not None:
        task.handled.logged = True


def tp_write(task: ProgramTask, text: str, *values: Any) -> None:
    shown = [text, *(str(each) for each in values if each is not None)]
    task.services.note(0, " ".join(shown))


def err_write(
    task: ProgramTask, warning: bool | None, info: bool | None, header: str, reason: str, *more: str | None
) -> None:
    kind = 80003 if info else 80002 if warning else 80001
    task.services.note(kind, ": ".join([header, reason, *(line for line in more if line)]))


DOES = MappingProxyType(
    {
        "ExitCycle": exit_cycle,
        "WaitTime": wait_time,
        "WaitUntil": wait_until,
        "SkipWarn": skip_warn,
        "TPWrite": tp_write,
        "ErrWrite": err_write,
    }
)
