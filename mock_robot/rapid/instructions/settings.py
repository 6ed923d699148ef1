"""Motion settings, and the active tool, work object and load: what a program finds and may leave as it was.

C_MOTSET holds the settings (motsetdata of 3HAC050917, its first components; those behind are not used).
"""

from types import MappingProxyType
from typing import Any

from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.scope import Persistent, Slot
from mock_robot.rapid.tasks import ProgramTask
from mock_robot.rapid.types import Type

VEL, SING, CONF = 0, 2, 3
"""Places in motsetdata."""


def _set(task: ProgramTask, component: int, values: dict[int, Any]) -> None:
    settings = [list(each) for each in task.settings.value]
    for place, value in values.items():
        settings[component][place] = value
    task.settings.value = settings


def vel_set(task: ProgramTask, override: float, most: float) -> None:
    _set(task, VEL, {0: override, 1: most})
    task.services.unit.override_percent, task.services.unit.max_speed_mm_s = override, most


def _activate(task: ProgramTask, kind: str, slot: Slot) -> None:
    task.services.unit.active[kind] = (slot.name if isinstance(slot, Persistent) else "", slot.value)


def note_move(task: ProgramTask, tool: Slot, wobj: Slot | None) -> None:
    """The tool and work object of a move are the active ones from then on; wobj0 without one."""
    _activate(task, "tooldata", tool)
    if wobj is None:
        task.services.unit.active.pop("wobjdata", None)
    else:
        _activate(task, "wobjdata", wobj)


_FACTORY = MappingProxyType({"tooldata": "tool0", "wobjdata": "wobj0", "loaddata": "load0"})


def _active_kind(given: tuple[Type, Slot]) -> str:
    if given[0].name not in _FACTORY:
        raise RapidError("ERR_SYSDATA_TYPE", f"{given[0].name} is no system data")
    return given[0].name


def get_sys_data(
    task: ProgramTask, task_name: str | None, destination: tuple[Type, Slot], object_name: Slot | None
) -> None:
    """Value and name of the active tool, work object or load."""
    unit, kind = task.services.unit, _active_kind(destination)
    if task_name is not None and task_name.casefold() != unit.task_name.casefold():
        raise RapidError("ERR_TASKNAME", f"{task_name} moves no arm")
    name, value = unit.active.get(kind, (_FACTORY[kind], None))
    if value is not None:
        destination[1].value = destination[0].copy(value)
    if object_name is not None:
        object_name.value = name


def set_sys_data(task: ProgramTask, source: tuple[Type, Slot], object_name: str | None) -> None:
    """With \\ObjectName the object of that name, otherwise the source."""
    kind = _active_kind(source)
    name = source[1].name if object_name is None and isinstance(source[1], Persistent) else object_name or ""
    task.services.unit.active[kind] = (name, source[0].copy(source[1].value))


DOES = MappingProxyType(
    {
        "VelSet": vel_set,
        "ConfJ": lambda task, on, off: _set(task, CONF, {0: not off}),  # the arm supervises it whatever is set
        "ConfL": lambda task, on, off: _set(task, CONF, {1: not off}),
        "SingArea": lambda task, wrist, lock, off: _set(task, SING, {0: bool(wrist), 1: bool(lock)}),  # never avoided
        "GripLoad": lambda task, load: _activate(task, "loaddata", load),
        "GetSysData": get_sys_data,
        "SetSysData": set_sys_data,
    }
)
