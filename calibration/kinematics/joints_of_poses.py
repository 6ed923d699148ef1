"""Joints of poses without any, by the drawing's inverse kinematics."""

from collections.abc import Sequence

import numpy as np

from calibration.errors import GeometryError
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
) -> Array:
    """Joints (n, 6) of poses (4, 4): the known ones, else those of the pose's confdata.

    A pose has up to eight solutions, of which views show none to be the right one: with axis 5 turned over and axes 4
    and 6 by half a turn all of them fit alike, with other errors of the arm. Raises GeometryError for poses with
    neither, UnreachablePoseError.
    """
    both = list(zip(known_rad, confdata, strict=True))
    neither = [at for at, (known, posture) in enumerate(both) if known is None and posture is None]
    if neither:
        first = ", ".join(map(str, neither[:6])) + (" ..." if len(neither) > 6 else "")
        raise GeometryError(
            f"{len(neither)} pictures hold neither joints nor confdata ({first}): a pose has several postures,"
            " and the arm's errors differ between them: record joints_deg, or the pose's confdata"
        )
    found: list[Array] = []
    for pose, known, posture in zip(base_T_flange, known_rad, confdata, strict=True):
        joints = known
        if known is None and posture is not None:
            goes_on = found and tuple(arm.configuration(found[-1])) == posture
            joints = arm.matching(pose, posture, found[-1] if goes_on else None)
        assert joints is not None
        found.append(joints)
    return np.array(found)


def joints_in_range(arm: Arm, base_T_flange: Array, lowest_rad: Array, highest_rad: Array) -> Array:
    """Of the joints (6,) that reach a pose (4, 4) those least outside a range. Raises UnreachablePoseError."""
    middle = (lowest_rad + highest_rad) / 2
    half = np.maximum((highest_rad - lowest_rad) / 2, MIN_RANGE_RAD)
    solutions = arm.inverse(base_T_flange, middle)
    best: Array = solutions[np.argmin((np.abs(solutions - middle) / half).max(axis=1))]
    return best
