"""Joints of poses without any, by the drawing's inverse kinematics."""

from collections.abc import Sequence

import numpy as np

from calibration.kinematics.arm import Arm
from calibration.transforms import Array

MIN_RANGE_RAD = float(np.radians(5.0))
"""Half the range of an axis that hardly moved."""

Confdata = tuple[int, int, int, int]


def joints_of_poses(
    arm: Arm,
    base_T_flange: Sequence[Array],
    known_rad: Sequence[Array | None],
    confdata: Sequence[Confdata | None],
) -> list[Array | None]:
    """Joints (6,) of each pose (4, 4): the known ones, else those of its confdata, else None.

    A pose has up to eight solutions, of which pictures show none to be the right one: with axis 5 turned over and axes
    4 and 6 by half a turn all of them fit alike, with other errors of the arm. Raises UnreachablePoseError.
    """
    found: list[Array | None] = []
    for pose, known, posture in zip(base_T_flange, known_rad, confdata, strict=True):
        joints = known
        if known is None and posture is not None:
            before = found[-1] if found else None
            goes_on = before is not None and tuple(arm.configuration(before)) == posture
            joints = arm.matching(pose, posture, before if goes_on else None)
        found.append(joints)
    return found


def joints_in_range(arm: Arm, base_T_flange: Array, lowest_rad: Array, highest_rad: Array) -> Array:
    """Of the joints (6,) that reach a pose (4, 4) those least outside a range. Raises UnreachablePoseError."""
    middle = (lowest_rad + highest_rad) / 2
    half = np.maximum((highest_rad - lowest_rad) / 2, MIN_RANGE_RAD)
    solutions = arm.inverse(base_T_flange, middle)
    best: Array = solutions[np.argmin((np.abs(solutions - middle) / half).max(axis=1))]
    return best
