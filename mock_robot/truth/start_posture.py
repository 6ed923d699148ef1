"""Posture of the arm at start: the camera looks straight at the target's centre."""

from contextlib import suppress

import numpy as np

from calibration.kinematics.arm import UnreachablePoseError
from calibration.kinematics.seven_axes import AnyArm, SevenAxisArm
from calibration.transforms import Array, inverse, map_points, rotation_from_vector, transform
from mock_robot.scene.printed_target import print_target
from mock_robot.truth.truth import CellTruth

START_DISTANCE_MM = 600.0
ROLLS = 24
SEVEN_AXES_USUAL_RAD = np.radians([0.0, -60.0, 0.0, 0.0, 60.0, 0.0, 0.0])
"""Near the middle of the ranges: elbow up, wrist bent."""


def target_middle_mm(truth: CellTruth) -> Array:
    """Centre of the printed sheet in the base frame (3,)."""
    middle = np.append(print_target(truth.target, truth.sheet).outline_mm.mean(axis=0), 0.0)
    return np.asarray(map_points(truth.base_T_target, middle[None])[0])


def _looking(truth: CellTruth, roll_rad: float) -> Array:
    """base_T_flange at which the camera sees the target's centre on its axis, square on, turned by the roll.

    Of a SCARA as square as it can: its flange looks straight down.
    """
    if truth.scara:
        turn = rotation_from_vector([0.0, 0.0, roll_rad]) @ np.diag([1.0, -1.0, -1.0])
        seen = map_points(truth.flange_T_camera, np.array([[0.0, 0.0, START_DISTANCE_MM]]))[0]
        return transform(turn, target_middle_mm(truth) - turn @ seen)
    if truth.setup == "eye-in-hand":
        base_R_target = truth.base_T_target[:3, :3]
        base_R_camera = base_R_target @ rotation_from_vector([0.0, 0.0, roll_rad])
        above_mm = target_middle_mm(truth) - START_DISTANCE_MM * base_R_target[:, 2]
        return transform(base_R_camera, above_mm) @ inverse(truth.flange_T_camera)
    turn = rotation_from_vector([0.0, 0.0, -roll_rad])
    middle = np.append(print_target(truth.target, truth.sheet).outline_mm.mean(axis=0), 0.0)
    camera_T_target = transform(turn, [0.0, 0.0, START_DISTANCE_MM] - turn @ middle)
    return truth.mount_T_camera @ camera_T_target @ inverse(truth.anchor_T_target)


def start_joints(arm: AnyArm, truth: CellTruth) -> Array:
    """Joints (6,) for that view, at the roll farthest from limits and singularities; (7,) of an arm with seven axes."""
    if isinstance(arm, SevenAxisArm):
        return arm.nearest(_looking(truth, 0.0), SEVEN_AXES_USUAL_RAD)
    middle_rad = (np.array(arm.lower_rad) + np.array(arm.upper_rad)) / 2
    half_rad = (np.array(arm.upper_rad) - np.array(arm.lower_rad)) / 2

    def clearance(joints: Array) -> tuple[float, float]:
        room = float((1 - np.abs(joints - middle_rad) / half_rad).min())
        return round(min(room, float(arm.singularity_clearance(joints))), 1), -float(np.abs(joints).max())

    candidates: list[Array] = []
    for roll_rad in np.linspace(-np.pi, np.pi, ROLLS, endpoint=False):
        with suppress(UnreachablePoseError):
            candidates += [
                joints
                for joints in arm.inverse(_looking(truth, float(roll_rad)))
                if arm.configuration(joints).cfx in (0, 1)
            ]
    if not candidates:
        raise UnreachablePoseError(
            f"{arm.name} cannot look at the target of this cell", "put the target nearer to the robot"
        )
    return max(candidates, key=clearance)
