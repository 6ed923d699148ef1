"""The path of flange and load while all axes turn in proportion (joint interpolation, MoveJ), and a box around it."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calibration.kinematics.arm import Arm
from calibration.transforms import Array

MAX_STEP_RAD = np.radians(5.0)
"""Most that an axis turns between two points of the path that are computed."""
MAX_CHORD_ERROR_MM = 0.5
"""Most that the flange leaves the straight line between two points of the path that are computed."""


class OutsideBox(NamedTuple):
    """Where a path leaves a box furthest: `along` the path from 0 to 1, the point there (3,), and how far outside.

    `carried`: the point is one of what the flange carries, not the flange.
    """

    along: float
    flange_mm: Array
    outside_mm: float
    carried: bool = False


@dataclass(frozen=True)
class Box:
    """Corners (3,) in the base frame, mm."""

    low_mm: tuple[float, float, float]
    high_mm: tuple[float, float, float]

    def outside_mm(self, points_mm: ArrayLike) -> Array:
        """How far points (..., 3) lie outside: the largest excess over a face; 0 inside."""
        points = np.asarray(points_mm, float)
        excess: Array = np.maximum(np.array(self.low_mm) - points, points - np.array(self.high_mm)).max(-1)
        return np.maximum(excess, 0.0)


FLANGE: Array = np.zeros((1, 3))
"""The flange's own origin, in its frame."""


def path_mm(arm: Arm, start_rad: Array, ends_rad: Array, points_mm: Array = FLANGE) -> Array:
    """Points (..., n, k, 3) in the base, from joints (6,) to each of joints (..., 6), both included.

    `points_mm` (k, 3): in the flange's frame. Between two steps no axis turns by more than MAX_STEP_RAD, and no point
    departs from its chord by more than MAX_CHORD_ERROR_MM.
    """
    travel = ends_rad - start_rad
    reach_mm = float(np.linalg.norm(points_mm, axis=-1).max())
    along = np.linspace(0.0, 1.0, _steps(arm, travel, reach_mm) + 1)
    joints = start_rad + along[:, None] * travel[..., None, :]
    if reach_mm == 0.0:
        origins: Array = arm.skeleton(joints)[..., 3, None, :]
        return origins
    flanges = arm.forward(joints)
    points: Array = points_mm @ np.swapaxes(flanges[..., :3, :3], -1, -2) + flanges[..., None, :3, 3]
    return points


def leaves_box(
    arm: Arm, start_rad: Array, end_rad: Array, box: Box, slack_mm: float = 0.0, points_mm: Array = FLANGE
) -> OutsideBox | None:
    """Where the path between joints (6,) is furthest outside the box; None when never by more than `slack_mm`.

    `points_mm` (k, 3): what is checked, in the flange's frame, the flange's own origin first.
    """
    points = path_mm(arm, start_rad, end_rad, points_mm)
    outside = box.outside_mm(points)
    step, point = np.unravel_index(int(outside.argmax()), outside.shape)
    if outside[step, point] <= slack_mm:
        return None
    found = points[step, point]
    return OutsideBox(float(step / (len(points) - 1)), found, float(outside[step, point]), bool(point))


def stay_in_box(arm: Arm, start_rad: Array, ends_rad: Array, box: Box, points_mm: Array = FLANGE) -> NDArray[np.bool_]:
    """Mask (n,) of the joints (n, 6) to which the path is never outside the box."""
    outside = box.outside_mm(path_mm(arm, start_rad, ends_rad, points_mm))
    return np.asarray(np.all(outside <= 0.0, axis=(-1, -2)))


def _steps(arm: Arm, travel_rad: Array, reach_mm: float) -> int:
    """Number of steps for the longest of the travels (..., 6), for points `reach_mm` from the flange's origin.

    The chord error of a curve p(t), 0 <= t <= 1, in n equal steps is at most max|p''| / (8 n²). With the distances
    that a point can have from axes 1 to 3 (the whole arm), from axes 4 and 5 (wrist to point) and from axis 6 (which
    passes through the flange's origin), |p''| <= sum of distance_ij |travel_i travel_j|, where the outer axis decides
    distance_ij.
    """
    travel = np.abs(travel_rad)
    inner, wrist, last = travel[..., :3].sum(-1), travel[..., 3:5].sum(-1), travel[..., 5]
    tool_mm = arm.wrist_to_flange_mm + reach_mm
    curved_mm = (arm.reach_mm + tool_mm) * inner**2 + tool_mm * (2 * inner * wrist + wrist**2)
    curved_mm = curved_mm + reach_mm * (2 * (inner + wrist) * last + last**2)
    steps = np.maximum(np.sqrt(curved_mm / (8 * MAX_CHORD_ERROR_MM)), travel.max(-1) / MAX_STEP_RAD)
    return max(1, int(np.ceil(steps.max(initial=0.0))))
