"""The joints of a goal, and the speeds of its move, as the RAPID of deploy/rapid takes them."""

from collections.abc import Iterator
from itertools import product

import numpy as np

from calibration.kinematics.arm import Arm, OtherConfiguration, UnreachablePoseError
from calibration.kinematics.seven_axes import AnyArm, SevenAxisArm
from calibration.transforms import Array, rotation_angle_rad

Confdata = tuple[int, int, int, int]


def goal_joints(
    arm: AnyArm, base_T_flange: Array, configuration: Confdata, here_rad: Array, arm_angle_deg: float = 0.0
) -> Array:
    """Joints (6,) in that configuration, or in the neighbouring one with the least joint travel (cell_found_near).

    Of an arm with seven axes (7,), with that arm angle and in that configuration. Raises UnreachablePoseError.
    """
    if isinstance(arm, SevenAxisArm):
        return arm.matching(base_T_flange, float(np.radians(arm_angle_deg)), configuration, here_rad)
    try:
        joints: Array = arm.matching(base_T_flange, configuration, near_rad=here_rad)
        return joints
    except OtherConfiguration:
        found = [*_near(arm, base_T_flange, configuration, here_rad)]
        if not found:
            raise
    return min(found, key=lambda each: float(np.abs(each - here_rad).max()))


def _near(arm: Arm, base_T_flange: Array, configuration: Confdata, here_rad: Array) -> Iterator[Array]:
    cf1, cf4, cf6, cfx = configuration
    for i, j, k in product((-1, 0, 1), repeat=3):
        try:
            yield arm.matching(base_T_flange, (cf1 + i, cf4 + j, cf6 + k, cfx), near_rad=here_rad)
        except UnreachablePoseError:
            continue


def speeds_sharing(start: Array, end: Array, limit_mm_s: float, reach_mm: float) -> tuple[float, float]:
    """Speed (mm/s) and turn (rad/s) of the flange between poses (4, 4), as cell_speed of CELL_motion shares them.

    speed + turn * reach_mm is the limit: no point within `reach_mm` of the flange moves faster.
    """
    way_mm = float(np.linalg.norm(end[:3, 3] - start[:3, 3]))
    sweep_mm = reach_mm * float(rotation_angle_rad(start[:3, :3].T @ end[:3, :3]))
    share = way_mm / (way_mm + sweep_mm) if way_mm + sweep_mm > 0.001 else 0.9
    share = min(max(share, 0.25), 0.9)
    return share * limit_mm_s, (1.0 - share) * limit_mm_s / reach_mm
