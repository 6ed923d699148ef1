"""Names of tasks and mechanical units, the configuration, motion settings without effect here, and calls by name."""

from types import MappingProxyType
from typing import Any

from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.instructions.poses import c_rob_t
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.tasks import ProgramTask
from mock_robot.rapid.types import Type
from mock_robot.rapid.values import integer, short, single

UNIT = "ROB_1"
AXES = 6
RUN_CONTINUOUS = 1.0
MAX_SPEED_MM_S, MAX_TURN_DEG_S = 5000.0, 500.0
"""vmax of system.rapid."""


def task_name(task: ProgramTask, reference: Slot | None, number: float | None, unit_task: Slot | None) -> str:
    if number is not None or unit_task is not None:
        raise RapidError("ERR_ARGVALERR", "the mock numbers no tasks")
    return task.name if reference is None else str(reference.value)


def unit_name(task: ProgramTask, unit: Slot) -> str:
    return UNIT


def next_unit(
    task: ProgramTask,
    place: Slot,
    name: Slot,
    tcp_robot: Slot | None,
    axes: Slot | None,
    unit_task: Slot | None,
    planner: Slot | None,
    active: Slot | None,
) -> bool:
    """One after the other from \\ListNumber 0 on: the mock has one."""
    if integer(place.value) >= 1:
        return False
    place.value, name.value = 1.0, UNIT
    for given, value in ((tcp_robot, True), (axes, float(AXES)), (unit_task, 1.0), (planner, 1.0), (active, True)):
        if given is not None:
            given.value = value
    return True


def is_task_executing(task: ProgramTask, name: str) -> bool:
    return name.casefold() == task.name.casefold() or name in task.services.queues.tasks


def current_position(task: ProgramTask, tool: Slot | None, wobj: Slot | None) -> list[float]:
    position: list[float] = c_rob_t(task, None, None, tool, wobj)[0]
    return position


def current_tool(task: ProgramTask, reference: Slot | None, name: str | None) -> list[Any]:
    value = task.services.unit.active.get("tooldata", ("tool0", None))[1]
    load = [0.001, [0.0, 0.0, 0.001], [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0]
    return [True, [[0.0] * 3, [1.0, 0.0, 0.0, 0.0]], load] if value is None else list(value)


def current_wobj(task: ProgramTask, reference: Slot | None, name: str | None) -> list[Any]:
    value = task.services.unit.active.get("wobjdata", ("wobj0", None))[1]
    frame = [[0.0] * 3, [1.0, 0.0, 0.0, 0.0]]
    return [False, True, "", frame, frame] if value is None else list(value)


def read_configuration(task: ProgramTask, path: str, attribute: str, data: tuple[Type, Slot]) -> None:
    """An attribute of /DOMAIN/TYPE/INSTANCE; only what the files name is known, no defaults of a controller."""
    domain, kind, instance = [*path.strip("/").split("/"), "", ""][:3]
    found = [
        each
        for each in task.services.configuration(domain.upper()).get(kind.upper(), [])
        if instance.casefold() in (each.get("Name", "").casefold(), each.get("name", "").casefold())
    ]
    known = {key.casefold(): value for key, value in found[0].items()} if found else {}
    if attribute.casefold() not in known:
        raise RapidError("ERR_CFG_NOTFND", f"no file of the configuration has {path} with {attribute}")
    text, (type_, slot) = known[attribute.casefold()], data
    try:
        slot.value = {"string": short, "bool": _truth}.get(type_.name, lambda value: single(float(value)))(text)
    except ValueError:
        raise RapidError("ERR_CFG_ILLTYPE", f"{path} {attribute} is {text!r}, no {type_.name}") from None


def _truth(text: str) -> bool:
    """An attribute without a value stands for TRUE."""
    return text.upper() in ("", "TRUE")


def get_data(task: ProgramTask, name: str, data: tuple[Type, Slot]) -> None:
    """The value of the data object of that name."""
    kind, slot = data
    slot.value = kind.copy(_data(task, name, kind).value)


def set_data(task: ProgramTask, name: str, data: tuple[Type, Any]) -> None:
    kind, value = data
    _data(task, name, kind).value = kind.copy(value)


def _data(task: ProgramTask, name: str, kind: Type) -> Slot:
    found = task.data(name.casefold())
    if found is None or found.slot is None:
        raise RapidError("ERR_SYM_ACCESS", f"no data is named {name}")
    if found.type != kind:
        raise RapidError("ERR_INVDIM", f"{name} is {found.type.name}, not {kind.name}")
    return found.slot


def call_by_number(task: ProgramTask, name: str, number: float) -> None:
    """CallByVar: the procedure of that name and number."""
    task.call(f"{name}{integer(number)}")


def connect_sensor(task: ProgramTask, sensor: Slot, *arguments: Any) -> None:
    """No sensor answers: the mock has none at the Sensor Interface."""
    raise RapidError("ERR_COMM_INIT_FAILED", "no sensor of the Sensor Interface answers")


def keep(task: ProgramTask, *settings: Any) -> None:
    """A setting of the motion that the simulated arm has no use for."""


def refresh_speed(task: ProgramTask, percent: float) -> None:
    task.services.panel.speed_override = min(max(percent / 100.0, 0.0), 1.0)


DOES = MappingProxyType(
    {
        "GetTaskName": task_name,
        "GetMecUnitName": unit_name,
        "GetNextMechUnit": next_unit,
        "TaskIsExecuting": is_task_executing,
        "RunMode": lambda task, main: RUN_CONTINUOUS,
        "CPos": current_position,
        "CTool": current_tool,
        "CWObj": current_wobj,
        "ReadCfgData": read_configuration,
        "CallByVar": call_by_number,
        "GetDataVal": get_data,
        "SetDataVal": set_data,
        "MaxRobSpeed": lambda task: MAX_SPEED_MM_S,
        "MaxRobReorientSpeed": lambda task: MAX_TURN_DEG_S,
        "GetModalPayloadMode": lambda task: 1.0,
        "MotionSup": keep,
        "PathAccLim": keep,
        "WorldAccLim": keep,
        "CirPathMode": keep,
        "SpeedLimAxis": keep,
        "SpeedLimCheckPoint": keep,
        "SpeedRefresh": refresh_speed,
        "SiConnect": connect_sensor,
        "SiSetCyclic": connect_sensor,
        "SiGetCyclic": connect_sensor,
        "SiClose": keep,
    }
)
