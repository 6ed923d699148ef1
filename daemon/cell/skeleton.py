"""The arm as points to draw."""

from dataclasses import astuple

from calibration.documents.pose import Vector
from calibration.kinematics.arm import Arm
from calibration.kinematics.seven_axes import AnyArm
from calibration.transforms import Array


def skeleton_mm(arm: AnyArm | None, joints_rad: Array | None) -> list[Vector] | None:
    """Base, shoulder, elbow, wrist and flange in the base frame, to 1 um; None where arm or joints are not known."""
    if arm is None or joints_rad is None:
        return None
    points = [(0.0, 0.0, 0.0)]
    for x, y, z in arm.skeleton(joints_rad):
        points.append((round(float(x), 3), round(float(y), 3), round(float(z), 3)))
    return points


def lengths_mm(arm: AnyArm | None) -> tuple[float, ...] | None:
    """Base to axis 2 forward and up, lower arm, axis 4 above axis 3, forearm, wrist to flange, axis 6 above axis 4.

    None for an arm with seven axes.
    """
    return (*astuple(arm)[1:7], arm.wrist_offset_mm) if isinstance(arm, Arm) else None
