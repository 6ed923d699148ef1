"""Numbers, strings, the arm's pose and the joints for a target. Angles are in degrees, as everywhere in RAPID."""

import math
from types import MappingProxyType
from typing import Any

from calibration.kinematics.arm import OutOfReach, UnreachablePoseError
from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.postures import flange_of, joints_rad, robax, singles, target_at
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.tasks import ProgramTask
from mock_robot.rapid.values import short, single


def acos(task: ProgramTask, value: float) -> float:
    if not -1.0 <= value <= 1.0:
        raise RapidError("ERR_ARGVALERR", f"Acos({value:g})")
    return single(math.degrees(math.acos(value)))


def sqrt(task: ProgramTask, value: float) -> float:
    if value < 0:
        raise RapidError("ERR_ARGVALERR", f"Sqrt({value:g})")
    return single(math.sqrt(value))


def trunc(task: ProgramTask, value: float, decimals: float | None) -> float:
    scale = 10.0 ** int(decimals or 0)
    return single(math.trunc(value * scale) / scale)


def n_orient(task: ProgramTask, rotation: list[float]) -> list[float]:
    norm = math.hypot(*rotation)
    if norm == 0.0:
        raise RapidError("ERR_ILLQUAT", "a rotation of zeros")
    return [single(part / norm) for part in rotation]


def num_to_str(task: ProgramTask, value: float, decimals: float, exponent: bool | None) -> str:
    places = int(decimals)
    return short(f"{value:.{places}E}" if exponent else f"{value:.{places}f}")


TOOL0 = [True, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]]]
"""The part of tool0 that a pose needs."""


def _unit(task: ProgramTask, task_name: str | None) -> Any:
    """Motion unit of the named task; a task without an arm must name one."""
    unit = task.services.unit
    if task_name is None and not task.motion:
        raise RapidError("ERR_TASKNAME", f"{task.name} moves no arm: name the task that does")
    if task_name is not None and task_name.casefold() != unit.task_name.casefold():
        raise RapidError("ERR_TASKNAME", f"{task_name} moves no arm")
    return unit


def _value(slot: Slot | None) -> Any:
    return None if slot is None else slot.value


def c_rob_t(task: ProgramTask, task_name: str | None, tool: Slot | None, wobj: Slot | None) -> list[Any]:
    unit = _unit(task, task_name)
    joints = unit.joints_now()
    world_T_flange = unit.world_T_flange(joints, unit.external_axes())
    pose = target_at(world_T_flange, TOOL0 if tool is None else tool.value, _value(wobj))
    return [*pose, [float(part) for part in unit.arm.configuration(joints)], unit.external_axes()]


def c_joint_t(task: ProgramTask, task_name: str | None) -> list[Any]:
    unit = _unit(task, task_name)
    return [robax(unit.joints_now()), unit.external_axes()]


def calc_joint_t(
    task: ProgramTask, target: list[Any], tool: Slot, wobj: Slot | None, error_number: Slot | None
) -> list[Any]:
    """Without \\ErrorNumber an unreachable target is an error; with it the number is set, the joints are undefined."""
    unit = task.services.unit
    try:
        if error_number is not None:
            error_number.value = 0.0
        flange = flange_of(target, tool.value, _value(wobj))
        joints = unit.joints_for(flange, target[2], target[3])
        return [robax(joints), list(target[3])]
    except UnreachablePoseError as error:
        name = "ERR_OUTSIDE_REACH" if isinstance(error, OutOfReach) else "ERR_ROBLIMIT"
        if error_number is None:
            raise RapidError(name, error.what) from None
        error_number.value = task.services.errors.numbers[name]
        return [[0.0] * 6, list(target[3])]


def calc_rob_t(task: ProgramTask, joints: list[Any], tool: Slot, wobj: Slot | None) -> list[Any]:
    unit, axes = task.services.unit, joints_rad(joints)
    pose = target_at(unit.world_T_flange(axes, joints[1]), tool.value, _value(wobj))
    return [*pose, singles(unit.arm.configuration(axes)), list(joints[1])]


DOES = MappingProxyType(
    {
        "Abs": lambda task, value: abs(value),
        "Acos": acos,
        "Sqrt": sqrt,
        "Trunc": trunc,
        "Distance": lambda task, first, second: single(math.dist(first, second)),
        "NOrient": n_orient,
        "StrLen": lambda task, text: float(len(text)),
        "NumToStr": num_to_str,
        "CRobT": c_rob_t,
        "CJointT": c_joint_t,
        "CalcJointT": calc_joint_t,
        "CalcRobT": calc_rob_t,
    }
)
