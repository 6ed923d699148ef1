"""Moves, and stopping them. The program goes on when the arm has arrived, also at a fly-by point.

A fly-by point is passed at standstill: the path lies within every zone, the cycle takes longer than a controller's.
"""

from collections.abc import Callable
from math import radians
from types import MappingProxyType
from typing import Any

from calibration.kinematics.arm import OtherConfiguration, UnreachablePoseError
from calibration.transforms import Array
from mock_robot.rapid.errors import ProgramStopped, RapidError
from mock_robot.rapid.instructions.settings import note_move
from mock_robot.rapid.postures import flange_of, joints_rad
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.tasks import EXECUTION_ERROR, ProgramTask

OUTSIDE_REACH, OTHER_CONFIGURATION, JOINT_OUT_OF_RANGE, NEAR_SINGULARITY = 50050, 50080, 50027, 50026
"""ABB's event numbers."""


def _move(*, linear: bool) -> Callable[..., None]:
    def move(
        task: ProgramTask,
        target: list[Any],
        _number: float | None,
        speed: list[float],
        _zone: list[Any],
        _z: float | None,
        _stop_point: list[Any] | None,
        tool: Slot,
        wobj: Slot | None,
    ) -> None:
        joints = joints_of(task, target, tool, wobj)
        note_move(task, tool, wobj)
        _take_along(task.services.unit, target[3])
        _travel(task, joints, speed, linear=linear)

    return move


def move_abs_j(
    task: ProgramTask,
    target: list[Any],
    _number: float | None,
    _no_offsets: bool | None,
    speed: list[float],
    _zone: list[Any],
    _z: float | None,
    _stop_point: list[Any] | None,
    tool: Slot,
    wobj: Slot | None,
) -> None:
    """There are no offsets of external axes here, so \\NoEoffs changes nothing."""
    unit, joints = own_unit(task), joints_rad(target)
    try:
        unit.arm.require_within_limits(joints)
    except UnreachablePoseError as error:
        raise ProgramStopped(JOINT_OUT_OF_RANGE, task.name, error.what) from error
    note_move(task, tool, wobj)
    _take_along(unit, target[1])
    _travel(task, joints, speed, linear=False)


def _take_along(unit: Any, wanted: list[float]) -> None:
    """External axes; those that the controller does not have, or the target leaves out (9E9), stay."""
    unit.external = [
        have if have >= 8.9e9 or want >= 8.9e9 else want for have, want in zip(unit.external, wanted, strict=True)
    ]


def own_unit(task: ProgramTask) -> Any:
    """The arm of a motion task. Raises ERR_NORUNUNIT in another one."""
    if not task.motion:
        raise RapidError("ERR_NORUNUNIT", f"{task.name} moves no arm")
    return task.services.unit


def joints_of(task: ProgramTask, target: list[Any], tool: Slot, wobj: Slot | None) -> Array:
    """Axes (6,) in rad of a robtarget; the program stops for one that cannot be reached."""
    flange = flange_of(target, tool.value, None if wobj is None else wobj.value)
    try:
        joints: Array = own_unit(task).joints_for(flange, target[2], target[3])
    except UnreachablePoseError as error:
        code = OTHER_CONFIGURATION if isinstance(error, OtherConfiguration) else OUTSIDE_REACH
        raise ProgramStopped(code, task.name, error.what) from error
    return joints


def _travel(task: ProgramTask, joints: Array, speed: list[float], *, linear: bool) -> None:
    unit = task.services.unit
    unit.order(joints, speed[0], radians(speed[1]), linear)
    while not unit.has_arrived():
        task.wait(unit.arrives_in_s(), until=unit.has_arrived)
    if unit.is_blocked():
        unit.clear()
        text = "the arm cannot follow the line: it comes close to a singularity, or to another posture"
        raise ProgramStopped(NEAR_SINGULARITY, task.name, text)


def stop_move(task: ProgramTask, quick: bool | None, all_tasks: bool | None) -> None:
    """Returns at once; the arm brakes meanwhile."""
    if all_tasks and task.motion:
        raise RapidError("ERR_ARGVALERR", "\\AllMotionTasks is for tasks that move nothing")
    task.services.unit.stop(task.name)


def start_move(task: ProgramTask, all_tasks: bool | None) -> None:
    """An arm that still brakes, or was moved away from its path, cannot start."""
    unit = task.services.unit
    if unit.is_moving():
        raise RapidError("ERR_ALRDY_MOVING", "the robot is moving")
    if unit.is_off_path():
        raise RapidError("ERR_PATHDIST", "the robot is too far from its path")
    if unit.held:
        raise RapidError("ERR_STARTMOVE", "the robot is in hold state")
    unit.start(task.name)


def clear_path(task: ProgramTask) -> None:
    """Allowed only when the arm was stopped or stands at its goal."""
    unit = task.services.unit
    if unit.is_moving() and not unit.stopped_by:
        raise ProgramStopped(EXECUTION_ERROR, task.name, "ClearPath while the arm moves: StopMove comes first")
    unit.clear()


def is_stop_move_active(task: ProgramTask, from_move_task: bool | None, from_other: bool | None) -> bool:
    unit = task.services.unit
    own = unit.task_name in unit.stopped_by
    return bool(own if from_move_task else unit.stopped_by - {unit.task_name})


DOES = MappingProxyType(
    {
        "MoveJ": _move(linear=False),
        "MoveL": _move(linear=True),
        "MoveAbsJ": move_abs_j,
        "StopMove": stop_move,
        "StartMove": start_move,
        "ClearPath": clear_path,
        "IsStopMoveAct": is_stop_move_active,
    }
)
