"""Instructions that programs in the field use and the shipped modules do not: counting, targets, strings, outputs."""

import math
from datetime import datetime
from types import MappingProxyType
from typing import Any

import numpy as np

from calibration.transforms import Array, quaternion_from_rotation, rotation_from_quaternion
from mock_robot.rapid.errors import CycleLeft, ProgramStopped
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.symbols import value_of
from mock_robot.rapid.tasks import EXECUTION_ERROR, ProgramTask
from mock_robot.rapid.types import Type
from mock_robot.rapid.values import single


def add(task: ProgramTask, name: Slot, value: float) -> None:
    name.value = single(name.value + value)


def clear(task: ProgramTask, name: Slot) -> None:
    name.value = 0.0


def increase(task: ProgramTask, name: Slot) -> None:
    add(task, name, 1.0)


def decrease(task: ProgramTask, name: Slot) -> None:
    add(task, name, -1.0)


def power(task: ProgramTask, base: float, exponent: float) -> float:
    return single(math.pow(base, exponent))


def tangent(task: ProgramTask, angle: float) -> float:
    return single(math.tan(math.radians(angle)))


def arc_tangent(task: ProgramTask, value: float) -> float:
    return single(math.degrees(math.atan(value)))


def arc_tangent_2(task: ProgramTask, y: float, x: float) -> float:
    return single(math.degrees(math.atan2(y, x)))


# --- targets ---


def offset(task: ProgramTask, point: list[Any], x: float, y: float, z: float) -> list[Any]:
    """A target shifted in the work object."""
    shifted = [single(part + by) for part, by in zip(point[0], (x, y, z), strict=True)]
    return [shifted, *point[1:]]


def relative_to_tool(
    task: ProgramTask, point: list[Any], x: float, y: float, z: float, *turns: float | None
) -> list[Any]:
    """A target shifted, then turned about x, y and z, in the tool."""
    rotation = rotation_from_quaternion(np.array(point[1]))
    shifted = np.array(point[0]) + rotation @ np.array([x, y, z])
    for axis, turn in enumerate(turns):
        rotation = rotation @ _turn(axis, turn or 0.0)
    return [_numbers(shifted), _numbers(quaternion_from_rotation(rotation)), *point[2:]]


def orient_zyx(task: ProgramTask, z: float, y: float, x: float) -> list[float]:
    """Rotation about z, then y, then x, in degrees."""
    return _numbers(quaternion_from_rotation(_turn(2, z) @ _turn(1, y) @ _turn(0, x)))


def euler_zyx(task: ProgramTask, x: bool | None, y: bool | None, z: bool | None, rotation: list[float]) -> float:
    """The angle about x, y or z, in degrees."""
    r = rotation_from_quaternion(np.array(rotation))
    about_y = math.asin(min(1.0, max(-1.0, -float(r[2, 0]))))
    angle = about_y if y else math.atan2(r[2, 1], r[2, 2]) if x else math.atan2(r[1, 0], r[0, 0])
    return single(math.degrees(angle))


def pose_mult(task: ProgramTask, first: list[Any], second: list[Any]) -> list[Any]:
    r1, r2 = (rotation_from_quaternion(np.array(pose[1])) for pose in (first, second))
    return [_numbers(np.array(first[0]) + r1 @ np.array(second[0])), _numbers(quaternion_from_rotation(r1 @ r2))]


def pose_inv(task: ProgramTask, pose: list[Any]) -> list[Any]:
    inverse = rotation_from_quaternion(np.array(pose[1])).T
    return [_numbers(-inverse @ np.array(pose[0])), _numbers(quaternion_from_rotation(inverse))]


def pose_vect(task: ProgramTask, pose: list[Any], point: list[float]) -> list[float]:
    return _numbers(np.array(pose[0]) + rotation_from_quaternion(np.array(pose[1])) @ np.array(point))


def _turn(axis: int, angle_deg: float) -> Array:
    rotation: Array = np.eye(3)
    first, second = (axis + 1) % 3, (axis + 2) % 3
    cos, sin = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    rotation[first, first] = rotation[second, second] = cos
    rotation[second, first], rotation[first, second] = sin, -sin
    return rotation


def _numbers(values: Array) -> list[float]:
    return [single(float(value)) for value in values]


# --- strings and the clock ---


def str_part(task: ProgramTask, text: str, place: float, length: float) -> str:
    return text[int(place) - 1 : int(place) - 1 + int(length)]


def str_find(task: ProgramTask, text: str, place: float, found: str, outside: bool | None) -> float:
    """First place from `place` on whose character is in the set, or outside it; one beyond the end without any."""
    places = range(int(place) - 1, len(text))
    return float(next((at + 1 for at in places if (text[at] in found) is not bool(outside)), len(text) + 1))


def str_match(task: ProgramTask, text: str, place: float, pattern: str) -> float:
    at = text.find(pattern, int(place) - 1)
    return float(at + 1 if at >= 0 else len(text) + 1)


def str_to_val(task: ProgramTask, text: str, value: tuple[Type, Slot]) -> bool:
    kind, slot = value
    try:
        slot.value = value_of(kind, text)
    except ValueError:
        return False
    return True


def c_date(task: ProgramTask) -> str:
    return f"{datetime.now():%Y-%m-%d}"


def c_time(task: ProgramTask) -> str:
    return f"{datetime.now():%H:%M:%S}"


# --- the program's end ---


def erase(task: ProgramTask) -> None:
    """The pendant is not simulated."""


def stop_program(task: ProgramTask, no_regain: bool | None = None, all_tasks: bool | None = None) -> None:
    """A start goes on behind it. Every task that moves stops, since there is one."""
    task.stop_by_itself(ProgramStopped(EXECUTION_ERROR, task.name, "Stop or Break"))


def end_program(task: ProgramTask) -> None:
    """A start begins at main."""
    task.stop_by_itself(ProgramStopped(EXECUTION_ERROR, task.name, "EXIT"))
    raise CycleLeft


DOES = MappingProxyType(
    {
        "Add": add,
        "Clear": clear,
        "Incr": increase,
        "Decr": decrease,
        "Pow": power,
        "Tan": tangent,
        "ATan": arc_tangent,
        "ATan2": arc_tangent_2,
        "Offs": offset,
        "RelTool": relative_to_tool,
        "OrientZYX": orient_zyx,
        "EulerZYX": euler_zyx,
        "PoseMult": pose_mult,
        "PoseInv": pose_inv,
        "PoseVect": pose_vect,
        "StrPart": str_part,
        "StrFind": str_find,
        "StrMatch": str_match,
        "StrToVal": str_to_val,
        "CDate": c_date,
        "CTime": c_time,
        "TPErase": erase,
        "Stop": stop_program,
        "Break": stop_program,
        "EXIT": end_program,
    }
)
