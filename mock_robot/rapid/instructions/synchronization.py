"""Tasks that wait for each other, and flags that one of them takes."""

from types import MappingProxyType
from typing import Any

from mock_robot.rapid.errors import ProgramStopped, RapidError
from mock_robot.rapid.instructions.conditions import wait_for
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.tasks import EXECUTION_ERROR, ProgramTask


def wait_for_tasks(
    task: ProgramTask, in_position: bool | None, identity: Slot, tasks: Slot, most_s: float | None
) -> None:
    """Until every task of the list is at such an instruction; a meeting is known by its list of tasks."""
    names = frozenset(str(each[0]).casefold() for each in tasks.value)
    if task.name.casefold() not in names:
        raise RapidError("ERR_ARGVALERR", f"{task.name} is not in the list of tasks")
    if in_position and task.motion:
        wait_for(task, lambda: not task.services.unit.is_moving())
    meetings, late = task.services.queues.meetings, Slot(False)
    met = meetings.enter(names, task.name.casefold())
    wait_for(task, met, most_s, late)
    if late.value:
        meetings.leave(names, task.name.casefold())
        raise RapidError("ERR_WAITSYNCTASK", f"not all of {', '.join(sorted(names))} came within {most_s:g} s")


def synchronize(task: ProgramTask, *arguments: Any) -> None:
    raise ProgramStopped(EXECUTION_ERROR, task.name, "coordinated motion needs MultiMove, which the mock has not")


def test_and_set(task: ProgramTask, flag: Slot) -> bool:
    """Take a flag that is FALSE, in one step."""
    with task.services.queues.flags:
        taken, flag.value = flag.value, True
    return not taken


def wait_test_and_set(task: ProgramTask, flag: Slot) -> None:
    wait_for(task, lambda: test_and_set(task, flag))


DOES = MappingProxyType(
    {
        "WaitSyncTask": wait_for_tasks,
        "IsSyncMoveOn": lambda task: False,
        "SyncMoveOn": synchronize,
        "SyncMoveOff": synchronize,
        "TestAndSet": test_and_set,
        "WaitTestAndSet": wait_test_and_set,
    }
)
