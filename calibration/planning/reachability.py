"""Check of which poses an arm can take without changing its posture on the way."""

import numpy as np
from numpy.typing import NDArray

from calibration.kinematics.arm import LIMIT_SLACK_RAD, Arm
from calibration.planning.viewpoint_selection import Reachable
from calibration.transforms import Array

MIN_SINGULARITY_CLEARANCE = 0.08
"""Least distance to a singularity (see `Arm.singularity_clearance`): about 5° of axis 5."""


def reachable_by(arm: Arm, joints_now_rad: Array | None = None, travel_rad: float = np.inf) -> Reachable:
    """A function that marks the poses (n, 4, 4) with a solution within the joint limits, clear of singularities.

    With `joints_now_rad` (6,) only in the arm's present posture (cfx), so that no move flips elbow or wrist, and with
    a travel of at most `travel_rad` for every joint.
    """
    postures = slice(None) if joints_now_rad is None else [arm.configuration(joints_now_rad).cfx]
    lower, upper = np.array(arm.lower_rad) - LIMIT_SLACK_RAD, np.array(arm.upper_rad) + LIMIT_SLACK_RAD

    def reachable(base_T_flange: Array) -> NDArray[np.bool_]:
        joints = arm.branches(base_T_flange, joints_now_rad)[:, postures]
        solved: NDArray[np.bool_] = np.all(np.isfinite(joints), axis=-1)
        joints = np.where(solved[:, :, None], joints, 0.0)
        # Each angle plus whole turns, the lowest not below its lower limit; reachable if not above the upper one.
        lowest = lower + np.mod(joints - lower, 2 * np.pi)
        in_limits = lowest <= upper
        if joints_now_rad is not None and np.isfinite(travel_rad):
            turns = np.round((joints_now_rad - lowest) / (2 * np.pi))
            nearest = lowest + 2 * np.pi * np.clip(turns, 0, np.floor((upper - lowest) / (2 * np.pi)))
            in_limits &= np.abs(nearest - joints_now_rad) <= travel_rad
        possible: NDArray[np.bool_] = (
            solved & np.all(in_limits, axis=-1) & (arm.singularity_clearance(joints) >= MIN_SINGULARITY_CLEARANCE)
        )
        result: NDArray[np.bool_] = np.any(possible, axis=-1)
        return result

    return reachable
