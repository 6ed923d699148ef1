"""Joints of poses without any, by the drawing's inverse kinematics."""

from collections.abc import Sequence

import numpy as np

from calibration.kinematics.arm import Arm
from calibration.transforms import Array

USUAL_RAD = np.radians([0.0, 0.0, 0.0, 0.0, 30.0, 0.0])
"""The posture in which most cells work: the part in front, elbow up, wrist not turned over."""


def joints_of_poses(arm: Arm, base_T_flange: Sequence[Array], known_rad: Sequence[Array | None]) -> Array:
    """Joints (n, 6) of poses (4, 4) one after the other: the known ones, else the nearest to the joints before.

    A pose has up to eight solutions and more whole turns; the arm is assumed to go on with the least travel, at first
    from the first known joints, else from USUAL_RAD. Raises UnreachablePoseError.
    """
    near = next((joints for joints in known_rad if joints is not None), USUAL_RAD)
    found = []
    for pose, known in zip(base_T_flange, known_rad, strict=True):
        near = arm.nearest(pose, near) if known is None else known
        found.append(near)
    return np.array(found)
