"""Converts the link's millimetres, degrees and quaternions to base_T_flange, and back."""

import math
from dataclasses import replace

import numpy as np

from calibration.errors import GeometryError
from calibration.kinematics.arm import Configuration
from calibration.transforms import Array, quaternion_from_rotation, rotation_from_quaternion, transform
from drivers.errors import GarbledAnswer, MoveRefused
from drivers.interfaces import JointGoal, MoveGoal, PoseReading, RobotSetup, RobotStatus, Standstill
from drivers.robots.abb.robtarget import MIN_UNUSED_AXIS, SEVEN, UNUSED_AXES, UNUSED_AXIS, reading_of
from protocols.cb.codes import Flag, MoveKind, Status
from protocols.cb.errors import FieldOutOfRange
from protocols.cb.layouts import pack
from protocols.cb.messages import Joints, Move, MoveJoints, Pose, Report, Setup

NO_AXIS_7 = "no axis 7 (eax_a is not used): [robot] model names an arm with seven axes, and this one has six"
ROTATION_TOLERANCE = 1e-6
MAX_POSITION_MM = 1e5
MAX_CONFIGURATION = 2**15
STANDS_PER_MILLE = 1000
"""Progress reported while no move is in progress."""
KINDS = {"joint": MoveKind.JOINT, "linear": MoveKind.LINEAR}


def pose_reading(device: str, pose: Pose, taken_at_s: float, axes: int = 6) -> PoseReading:
    """Convert a pose reply; raises GarbledAnswer for NaN or a quaternion whose norm is off by more than 2e-3."""
    if not np.all(np.isfinite([*pose.position_mm, *pose.quaternion_wxyz, *pose.external_axes])):
        raise _garbage_error(
            device, f"a pose with a number that is none: {_format(pose.position_mm)}, {_format(pose.quaternion_wxyz)}"
        )
    quaternion_wxyz = np.array(pose.quaternion_wxyz)
    try:  # SciPy normalises, so a quaternion rounded to float32 still gives a rotation
        base_R_flange = rotation_from_quaternion(quaternion_wxyz)
    except GeometryError as error:
        raise _garbage_error(device, str(error)) from error
    base_T_flange = transform(base_R_flange, pose.position_mm)
    reading = reading_of(base_T_flange, pose.configuration, pose.external_axes, axes, taken_at_s)
    return replace(reading, still=bool(pose.flags & Flag.IN_POSITION) and not pose.flags & Flag.MOVING)


def joints_rad(device: str, joints: Joints, axes: int = 6) -> Array:
    """Angles (axes,) of the arm's 6 or 7 axes in rad; raises GarbledAnswer."""
    axes_deg = (*joints.axes_deg, *joints.external_axes[: axes - 6])
    if not np.all(np.isfinite(axes_deg)):
        raise _garbage_error(device, f"axis angles with a number that is none: {_format(axes_deg)}")
    if max(axes_deg) >= MIN_UNUSED_AXIS:
        raise _garbage_error(device, NO_AXIS_7)
    angles_rad: Array = np.radians(np.array(axes_deg, float))
    return angles_rad


def robot_status(report: Report, taken_at_s: float) -> RobotStatus:
    """Convert the controller's flags."""
    flags = report.flags
    return RobotStatus(
        motors_on=bool(flags & Flag.MOTORS_ON),
        automatic=bool(flags & Flag.AUTO),
        emergency_stop=bool(flags & Flag.ESTOP),
        moving=bool(flags & Flag.MOVING),
        in_position=bool(flags & Flag.IN_POSITION),
        armed=bool(flags & Flag.ARMED),
        program_running=bool(flags & Flag.TASK_RUNNING),
        speed_limited=bool(flags & Flag.SPEED_LIMITED),
        taken_at_s=taken_at_s,
    )


def standstill(report: Report) -> Standstill:
    """Convert flags and progress.

    A move that was accepted and has not begun has a progress below 1000. One that was stopped is under way until the
    arm is in position; a program that is not running reports no position.
    """
    moving = report.flags & Flag.MOVING or report.progress_per_mille < STANDS_PER_MILLE
    settling = report.flags & Flag.TASK_RUNNING and not report.flags & Flag.IN_POSITION
    return Standstill(standing=not (moving or settling), disarmed=not report.flags & Flag.ARMED)


def move_of(device: str, goal: MoveGoal) -> Move:
    """Request for a goal; raises MoveRefused (BAD_FIELD) for a goal that cannot be encoded."""
    wrong = _goal_problem(goal)
    if wrong:
        raise _goal_error(device, wrong)
    position = goal.base_T_flange[:3, 3]
    quaternion = quaternion_from_rotation(goal.base_T_flange[:3, :3])
    move = Move(
        position_mm=(float(position[0]), float(position[1]), float(position[2])),
        quaternion_wxyz=(float(quaternion[0]), float(quaternion[1]), float(quaternion[2]), float(quaternion[3])),
        configuration=Configuration(*goal.posture),
        external_axes=_six(_with_first(goal.external_axes or UNUSED_AXES, goal.arm_angle_deg)),
        speed_mm_s=float(goal.speed_mm_s),
        kind=KINDS[goal.path],
    )
    try:
        pack(move)
    except FieldOutOfRange as error:
        raise _goal_error(device, error.reason) from error
    return move


def joint_move_of(device: str, goal: JointGoal, axes: int = 6) -> MoveJoints:
    """Request for the arm's 6 or 7 axis angles; raises MoveRefused (BAD_FIELD) for a goal that cannot be encoded."""
    axes_deg = np.degrees(np.asarray(goal.joints_rad, float))
    if axes_deg.shape != (axes,) or not np.all(np.isfinite(axes_deg)):
        raise _goal_error(device, f"axes {goal.joints_rad}; {axes} angles are wanted")
    if not (math.isfinite(goal.speed_mm_s) and goal.speed_mm_s > 0):
        raise _goal_error(device, f"a speed of {goal.speed_mm_s} mm/s")
    if len(goal.external_axes) not in (0, 6) or not np.all(np.isfinite(goal.external_axes)):
        raise _goal_error(device, f"external axes {goal.external_axes}")
    external_axes = _with_first(goal.external_axes or UNUSED_AXES, float(axes_deg[6]) if axes == SEVEN else None)
    return MoveJoints(_six(tuple(axes_deg[:6])), _six(external_axes), float(goal.speed_mm_s))


def robot_setup(setup: Setup) -> RobotSetup:
    """Convert the settings of the modules."""
    return RobotSetup(
        load_kg=setup.load_kg,
        load_centre_mm=setup.load_centre_mm,
        reach_mm=setup.reach_mm,
        speed_max_mm_s=setup.speed_max_mm_s,
        joint_travel_deg=setup.joint_travel_deg,
        world_box_mm=(setup.box_low_mm, setup.box_high_mm),
    )


def _goal_problem(goal: MoveGoal) -> str:
    base_T_flange = np.asarray(goal.base_T_flange, float)
    if base_T_flange.shape != (4, 4) or not np.all(np.isfinite(base_T_flange)):
        return "base_T_flange is not a 4×4 transform of finite numbers"
    base_R_flange = base_T_flange[:3, :3]
    orthonormal = np.allclose(base_R_flange @ base_R_flange.T, np.eye(3), atol=ROTATION_TOLERANCE)
    if not orthonormal or np.linalg.det(base_R_flange) < 0 or not np.array_equal(base_T_flange[3], (0, 0, 0, 1)):
        return "base_T_flange is not a rotation and a translation"
    if np.max(np.abs(base_T_flange[:3, 3])) > MAX_POSITION_MM:
        return f"a position beyond {MAX_POSITION_MM:g} mm; positions are millimetres"
    if not (math.isfinite(goal.speed_mm_s) and goal.speed_mm_s > 0):
        return f"a speed of {goal.speed_mm_s} mm/s"
    if len(goal.external_axes) not in (0, 6) or not np.all(np.isfinite(goal.external_axes)):
        return f"external axes {goal.external_axes}; six numbers are wanted, {UNUSED_AXIS:g} where there is none"
    if goal.arm_angle_deg is not None and not math.isfinite(goal.arm_angle_deg):
        return f"an arm angle of {goal.arm_angle_deg} deg"
    if len(goal.posture) != 4 or any(abs(quarter) >= MAX_CONFIGURATION for quarter in goal.posture):
        return f"the configuration {tuple(goal.posture)}"
    return "" if goal.path in KINDS else f"the path {goal.path!r}; joint or linear"


def _with_first(external_axes: tuple[float, ...], value: float | None) -> tuple[float, ...]:
    """The external axes with axis 7 or the arm angle, where there is one, in their first place."""
    return external_axes if value is None else (value, *external_axes[1:])


def _six(axes: tuple[float, ...]) -> tuple[float, float, float, float, float, float]:
    a, b, c, d, e, f = (float(axis) for axis in axes)
    return a, b, c, d, e, f


def _goal_error(device: str, wrong: str) -> MoveRefused:
    return MoveRefused(device, f"the goal was not sent: {wrong}", "correct the goal", Status.BAD_FIELD.name)


def _format(numbers: tuple[float, ...]) -> str:
    return f"({', '.join(f'{number:.6g}' for number in numbers)})"


def _garbage_error(device: str, what: str) -> GarbledAnswer:
    return GarbledAnswer(device, what, "nothing is done with it; look at the controller's program and the line")
