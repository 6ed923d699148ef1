"""Joints of poses without any, by the drawing's inverse kinematics."""

from collections.abc import Sequence

import numpy as np

from calibration.kinematics.arm import Arm
from calibration.transforms import Array

USUAL_RAD = np.radians([0.0, 0.0, 0.0, 0.0, 30.0, 0.0])
"""The posture in which most cells work: the part in front, elbow up, wrist not turned over."""

MIN_RANGE_RAD = float(np.radians(5.0))
"""Half the range of an axis that hardly moved."""

Confdata = tuple[int, int, int, int]


def joints_of_poses(
    arm: Arm,
    base_T_flange: Sequence[Array],
    known_rad: Sequence[Array | None],
    confdata: Sequence[Confdata | None] | None = None,
) -> Array:
    """Joints (n, 6) of poses (4, 4): the known ones, those of the pose's confdata, else the nearest to those before.

    A pose has up to eight solutions and more whole turns; the arm is assumed to go on with the least travel, at first
    from the first known joints, else from USUAL_RAD. Raises UnreachablePoseError.
    """
    postures = confdata or [None] * len(base_T_flange)
    near = next((joints for joints in known_rad if joints is not None), USUAL_RAD)
    found = []
    for pose, known, posture in zip(base_T_flange, known_rad, postures, strict=True):
        if known is not None:
            near = known
        elif posture is not None:
            near = arm.matching(pose, posture, near if tuple(arm.configuration(near)) == posture else None)
        else:
            near = arm.nearest(pose, near)
        found.append(near)
    return np.array(found)


def joints_in_range(arm: Arm, base_T_flange: Array, lowest_rad: Array, highest_rad: Array) -> Array:
    """Of the joints (6,) that reach a pose (4, 4) those least outside a range. Raises UnreachablePoseError."""
    middle = (lowest_rad + highest_rad) / 2
    half = np.maximum((highest_rad - lowest_rad) / 2, MIN_RANGE_RAD)
    solutions = arm.inverse(base_T_flange, middle)
    best: Array = solutions[np.argmin((np.abs(solutions - middle) / half).max(axis=1))]
    return best
