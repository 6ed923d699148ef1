"""Check of which poses an arm can take without changing its posture or leaving its box on the way."""

import numpy as np
from numpy.typing import NDArray

from calibration.kinematics.arm import LIMIT_SLACK_RAD, Arm
from calibration.kinematics.joint_path import FLANGE, Box, stay_in_box
from calibration.planning.line_of_sight import LineOfSight
from calibration.planning.viewpoint_selection import Reachable
from calibration.transforms import Array

MIN_SINGULARITY_CLEARANCE = 0.08
"""Least distance to a singularity (see `Arm.singularity_clearance`): about 5° of axis 5."""


def reachable_by(
    arm: Arm,
    joints_now_rad: Array | None = None,
    travel_rad: float = np.inf,
    box: Box | None = None,
    points_mm: Array = FLANGE,
    sight: LineOfSight | None = None,
) -> Reachable:
    """A function that marks the poses (n, 4, 4) with a solution within the joint limits, clear of singularities.

    With `joints_now_rad` (6,) only in the arm's present posture (cfx), so that no move flips elbow or wrist, with a
    travel of at most `travel_rad` for every joint, and with a joint move that keeps `points_mm` (k, 3) of the flange's
    frame in `box`. With `sight` only where no link stands between camera and target.
    """

    def reachable(base_T_flange: Array) -> NDArray[np.bool_]:
        joints = _nearest_turns(arm, arm.branches(base_T_flange, joints_now_rad), joints_now_rad)
        solved: NDArray[np.bool_] = np.all(np.isfinite(joints), axis=-1)
        joints = np.where(solved[:, :, None], joints, 0.0)
        possible = solved & (arm.singularity_clearance(joints) >= MIN_SINGULARITY_CLEARANCE)
        if joints_now_rad is None:
            if sight is not None:
                possible[possible] = sight.is_clear(arm, joints[possible])
            return np.asarray(possible.any(axis=-1))
        posture = arm.configuration(joints_now_rad).cfx
        joints, possible = joints[:, posture::8], possible[:, posture::8]
        travel = np.where(possible, np.abs(joints - joints_now_rad).max(axis=-1), np.inf)
        joints = joints[np.arange(len(joints)), travel.argmin(axis=1)]
        result: NDArray[np.bool_] = possible.any(axis=1) & (travel.min(axis=1) <= travel_rad)
        if box is not None and result.any():
            result[result] = stay_in_box(arm, joints_now_rad, joints[result], box, points_mm=points_mm)
        if sight is not None and result.any():
            result[result] = sight.is_clear(arm, joints[result])
        return result

    return reachable


def _nearest_turns(arm: Arm, joints_rad: Array, near_rad: Array | None) -> Array:
    """Joints (..., 6) with whole turns added, as near to `near_rad` as the limits allow; NaN outside them."""
    lower, upper = np.array(arm.lower_rad) - LIMIT_SLACK_RAD, np.array(arm.upper_rad) + LIMIT_SLACK_RAD
    near = np.zeros(6) if near_rad is None else near_rad
    lowest = lower + np.mod(joints_rad - lower, 2 * np.pi)
    turns = np.clip(np.round((near - lowest) / (2 * np.pi)), 0, np.floor((upper - lowest) / (2 * np.pi)))
    result: Array = np.where(lowest <= upper, lowest + 2 * np.pi * turns, np.nan)
    return result
