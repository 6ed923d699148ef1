"""Moves, and stopping them. The program goes on when the arm has arrived, also at a fly-by point.

A fly-by point is passed at standstill: the path lies within every zone, the cycle takes longer than a controller's.
"""

from collections.abc import Callable, Sequence
from math import radians
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from calibration.kinematics.arm import OtherConfiguration, UnreachablePoseError
from calibration.transforms import Array, inverse
from mock_robot.rapid.errors import ProgramStopped, RapidError
from mock_robot.rapid.instructions.conditions import POLL_S, wait_for
from mock_robot.rapid.instructions.settings import note_move
from mock_robot.rapid.instructions.signals import set_do
from mock_robot.rapid.postures import flange_of, joints_rad
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.tasks import EXECUTION_ERROR, ProgramTask
from mock_robot.rapid.triggers import Trigger

OUTSIDE_REACH, OTHER_CONFIGURATION, JOINT_OUT_OF_RANGE, NEAR_SINGULARITY = 50050, 50080, 50027, 50026
"""ABB's event numbers."""


class Pace(NamedTuple):
    """Speed of a move: `speeddata`, \\V mm/s in place of its speed, or \\T seconds for the whole move.

    `concurrent`: the program goes on while the arm moves; the next move waits for it.
    """

    speed: list[float]
    v_mm_s: float | None = None
    seconds: float | None = None
    concurrent: bool = False


def _flange(task: ProgramTask, target: list[Any], tool: Slot, wobj: Slot | None) -> Array:
    """world_T_flange (4, 4)."""
    return flange_of(target, tool.value, None if wobj is None else wobj.value, task.services.unit.displacement)


def _reach(task: ProgramTask, target: list[Any], tool: Slot, wobj: Slot | None) -> Any:
    unit = own_unit(task)
    try:
        joints = unit.joints_for(_flange(task, target, tool, wobj), target[2], target[3])
    except UnreachablePoseError as error:
        code = OTHER_CONFIGURATION if isinstance(error, OtherConfiguration) else OUTSIDE_REACH
        raise ProgramStopped(code, task.name, error.what) from error
    note_move(task, tool, wobj)
    _take_along(unit, target[3])
    return joints


def _take_along(unit: Any, wanted: list[float]) -> None:
    """External axes; those that the controller does not have, or the target leaves out (9E9), stay."""
    unit.external = [
        have if have >= 8.9e9 or want >= 8.9e9 else want + offset
        for have, want, offset in zip(unit.external, wanted, unit.external_offsets, strict=True)
    ]


def _pace_and_frames(
    speed: list[float],
    v: float | None,
    t: float | None,
    _zone: list[Any],
    _z: float | None,
    _stop_point: list[Any] | None,
    tool: Slot,
    wobj: Slot | None,
) -> tuple[Pace, Slot, Slot | None]:
    """The last arguments of every Move instruction."""
    return Pace(speed, v, t), tool, wobj


def _move(*, linear: bool) -> Callable[..., None]:
    def move(
        task: ProgramTask, concurrent: bool | None, target: list[Any], _number: float | None, /, *rest: Any
    ) -> None:
        pace, tool, wobj = _pace_and_frames(*rest)
        joints = _reach(task, target, tool, wobj)
        _travel(task, joints, pace._replace(concurrent=bool(concurrent)), linear=linear)

    return move


def move_c(
    task: ProgramTask, concurrent: bool | None, via: list[Any], target: list[Any], _number: float | None, *rest: Any
) -> None:
    """The flange's arc passes where it is at the circle point; it turns evenly from start to end."""
    pace, tool, wobj = _pace_and_frames(*rest)
    joints, through = _reach(task, target, tool, wobj), _via_mm(task, via, tool, wobj)
    _travel(task, joints, pace._replace(concurrent=bool(concurrent)), linear=True, via_mm=through)


def _via_mm(task: ProgramTask, via: list[Any], tool: Slot, wobj: Slot | None) -> Array:
    unit = task.services.unit
    world_T_base = unit.cabinet.mounting.reported_world_T_base(tuple(unit.external))
    point: Array = (inverse(world_T_base) @ _flange(task, via, tool, wobj))[:3, 3]
    return point


def move_abs_j(
    task: ProgramTask,
    concurrent: bool | None,
    target: list[Any],
    _number: float | None,
    _no_offsets: bool | None,
    *rest: Any,
) -> None:
    """There are no offsets of external axes here, so \\NoEoffs changes nothing."""
    pace, tool, wobj = _pace_and_frames(*rest)
    unit, joints = own_unit(task), joints_rad(target)
    try:
        unit.arm.require_within_limits(joints)
    except UnreachablePoseError as error:
        raise ProgramStopped(JOINT_OUT_OF_RANGE, task.name, error.what) from error
    note_move(task, tool, wobj)
    _take_along(unit, target[1])
    _travel(task, joints, pace._replace(concurrent=bool(concurrent)), linear=False)


def _move_and_set(*, linear: bool) -> Callable[..., None]:
    """MoveJDO and MoveLDO: the output is set where the move ends."""

    def move(
        task: ProgramTask, target: list[Any], _number: float | None, speed: list[float], t: float | None,
        _zone: list[Any], tool: Slot, wobj: Slot | None, output: Slot, value: float,
    ) -> None:  # fmt: skip
        _travel(task, _reach(task, target, tool, wobj), Pace(speed, None, t), linear=linear)
        set_do(task, None, None, output, value)

    return move


def _move_and_call(*, linear: bool) -> Callable[..., None]:
    """MoveJSync and MoveLSync: the procedure is called where the move ends."""

    def move(
        task: ProgramTask, target: list[Any], _number: float | None, speed: list[float], t: float | None,
        _zone: list[Any], tool: Slot, wobj: Slot | None, procedure: str,
    ) -> None:  # fmt: skip
        _travel(task, _reach(task, target, tool, wobj), Pace(speed, None, t), linear=linear)
        task.call(procedure)

    return move


def _trigg(*, linear: bool) -> Callable[..., None]:
    def trigg(
        task: ProgramTask, target: list[Any], _number: float | None, speed: list[float], t: float | None, /, *rest: Any
    ) -> None:
        *triggers, _zone, _stop_point, tool, wobj = rest
        joints = _reach(task, target, tool, wobj)
        _travel(task, joints, Pace(speed, None, t), linear=linear, triggers=_triggers(triggers))

    return trigg


def trigg_c(
    task: ProgramTask,
    via: list[Any],
    target: list[Any],
    _number: float | None,
    speed: list[float],
    t: float | None,
    *rest: Any,
) -> None:
    """As MoveC, with triggers on the way."""
    *triggers, _zone, _stop_point, tool, wobj = rest
    joints, through = _reach(task, target, tool, wobj), _via_mm(task, via, tool, wobj)
    _travel(task, joints, Pace(speed, None, t), linear=True, via_mm=through, triggers=_triggers(triggers))


def _triggers(given: Sequence[Slot | None]) -> tuple[Trigger, ...]:
    return tuple(slot.value for slot in given if slot is not None)


def own_unit(task: ProgramTask) -> Any:
    """The arm of a motion task. Raises ERR_NORUNUNIT in another one."""
    if not task.motion:
        raise RapidError("ERR_NORUNUNIT", f"{task.name} moves no arm")
    return task.services.unit


def _travel(
    task: ProgramTask,
    joints: Array,
    pace: Pace,
    *,
    linear: bool,
    via_mm: Array | None = None,
    triggers: Sequence[Trigger] = (),
) -> None:
    unit = task.services.unit
    _await_concurrent(task)
    began_mm, ends_mm = unit.tool_mm(), None
    unit.order(joints, *_speed(unit, joints, pace), linear, via_mm)
    if pace.concurrent:
        unit.concurrent = True
        return
    waiting = list(triggers)
    if waiting or unit.forbidden:
        ends_mm = _tool_mm_at(unit, joints)
    while not unit.has_arrived():
        wait_s = unit.arrives_in_s()
        if ends_mm is not None:
            here = unit.tool_mm()
            waiting = [each for each in waiting if not each.fire(task, here, began_mm, ends_mm, unit.ends_in_s())]
            _require_allowed(task, here)
            wait_s = min(wait_s, POLL_S)
        task.wait(wait_s, until=unit.has_arrived)
    for each in waiting:
        each.do(task)
    _require_followed(task)


def _await_concurrent(task: ProgramTask) -> None:
    """Wait for a move that the program did not wait for."""
    unit = task.services.unit
    if unit.concurrent:
        wait_for(task, unit.has_arrived)
        unit.concurrent = False
        _require_followed(task)


def _require_followed(task: ProgramTask) -> None:
    unit = task.services.unit
    if unit.is_blocked():
        unit.clear()
        text = "the arm cannot follow the line: it comes close to a singularity, or to another posture"
        raise ProgramStopped(NEAR_SINGULARITY, task.name, text)


def _speed(unit: Any, joints: Array, pace: Pace) -> tuple[float, float]:
    """mm/s, and rad/s of reorientation."""
    turn_rad_s = radians(pace.speed[1])
    if pace.seconds is None:
        return pace.speed[0] if pace.v_mm_s is None else pace.v_mm_s, turn_rad_s
    way_mm = float(np.linalg.norm(_tool_mm_at(unit, joints) - unit.tool_mm()))
    return max(way_mm / max(pace.seconds, 1e-3), 1e-3), turn_rad_s


def _tool_mm_at(unit: Any, joints: Array) -> Array:
    """Position (3,) of the tool in the world at the end of a move."""
    now = unit.world_T_flange(unit.joints_now(), unit.external_axes())
    end = unit.world_T_flange(joints, unit.external_axes())
    place: Array = end[:3, :3] @ now[:3, :3].T @ (unit.tool_mm() - now[:3, 3]) + end[:3, 3]
    return place


def _require_allowed(task: ProgramTask, here: Array) -> None:
    """A world zone stops the arm, and the program."""
    unit = task.services.unit
    if any(inside(here) for inside in unit.forbidden.values()):
        unit.clear()
        raise ProgramStopped(EXECUTION_ERROR, task.name, "the tool entered a world zone that is supervised")


def wait_rob(task: ProgramTask, in_position: bool | None, zero_speed: bool | None) -> None:
    """Every move of the mock ends at a stop point: until the arm stands."""
    unit = own_unit(task)
    _await_concurrent(task)
    wait_for(task, lambda: not unit.is_moving())


def stop_move(task: ProgramTask, all_tasks: bool | None) -> None:
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
    if not unit.may_start():
        raise RapidError("ERR_STARTMOVE", "the robot is in hold state")
    unit.start(task.name)


def clear_path(task: ProgramTask) -> None:
    """Allowed only when the arm was stopped or stands at its goal."""
    unit = task.services.unit
    if unit.is_moving() and not unit.stopped_by:
        raise ProgramStopped(EXECUTION_ERROR, task.name, "ClearPath while the arm moves: StopMove comes first")
    unit.clear()


def store_path(task: ProgramTask) -> None:
    """Set the interrupted move aside; the arm must stand."""
    own_unit(task)
    wait_for(task, lambda: not task.services.unit.is_moving())
    task.services.unit.store_path()


def restore_path(task: ProgramTask) -> None:
    if not own_unit(task).restore_path():
        raise ProgramStopped(EXECUTION_ERROR, task.name, "RestoPath without StorePath")


def is_stop_move_active(task: ProgramTask, from_move_task: bool | None, from_other: bool | None) -> bool:
    unit = task.services.unit
    own = unit.task_name in unit.stopped_by
    return bool(own if from_move_task else unit.stopped_by - {unit.task_name})


DOES = MappingProxyType(
    {
        "MoveJ": _move(linear=False),
        "MoveL": _move(linear=True),
        "MoveC": move_c,
        "MoveAbsJ": move_abs_j,
        "MoveJDO": _move_and_set(linear=False),
        "MoveLDO": _move_and_set(linear=True),
        "MoveJSync": _move_and_call(linear=False),
        "MoveLSync": _move_and_call(linear=True),
        "TriggJ": _trigg(linear=False),
        "TriggL": _trigg(linear=True),
        "TriggC": trigg_c,
        "WaitRob": wait_rob,
        "StopMove": stop_move,
        "StartMove": start_move,
        "ClearPath": clear_path,
        "StorePath": store_path,
        "RestoPath": restore_path,
        "IsStopMoveAct": is_stop_move_active,
    }
)
