"""Joints of poses without any, by the drawing's inverse kinematics."""

from collections.abc import Sequence

import numpy as np

from calibration.kinematics.arm import Arm
from calibration.transforms import Array

USUAL_RAD = np.radians([0.0, 0.0, 0.0, 0.0, 30.0, 0.0])
"""The posture in which most cells work: the part in front, elbow up, wrist not turned over."""


MIN_RANGE_RAD = float(np.radians(5.0))
"""Half the range of an axis that hardly moved."""


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


def joints_in_range(arm: Arm, base_T_flange: Array, lowest_rad: Array, highest_rad: Array) -> Array:
    """Of the joints (6,) that reach a pose (4, 4) those least outside a range. Raises UnreachablePoseError."""
    middle = (lowest_rad + highest_rad) / 2
    half = np.maximum((highest_rad - lowest_rad) / 2, MIN_RANGE_RAD)
    solutions = arm.inverse(base_T_flange, middle)
    best: Array = solutions[np.argmin((np.abs(solutions - middle) / half).max(axis=1))]
    return best
