"""The arm as points to draw."""

from calibration.documents.pose import Vector
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
