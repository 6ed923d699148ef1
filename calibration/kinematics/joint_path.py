"""The path of the flange while all axes turn in proportion (joint interpolation, ABB's MoveJ), and a box around it."""

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
    """Where a path leaves a box furthest: `along` the path from 0 to 1, the flange there (3,), and how far outside."""

    along: float
    flange_mm: Array
    outside_mm: float


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


def flange_path_mm(arm: Arm, start_rad: Array, ends_rad: Array) -> Array:
    """Points (..., n, 3) of the flange in the base, from joints (6,) to each of joints (..., 6), both included.

    Between two points no axis turns by more than MAX_STEP_RAD, and the flange departs from their chord by less than
    MAX_CHORD_ERROR_MM.
    """
    travel = ends_rad - start_rad
    along = np.linspace(0.0, 1.0, _steps(arm, travel) + 1)
    joints = start_rad + along[:, None] * travel[..., None, :]
    points: Array = arm.skeleton(joints)[..., 3, :]
    return points


def leaves_box(arm: Arm, start_rad: Array, end_rad: Array, box: Box, slack_mm: float = 0.0) -> OutsideBox | None:
    """Where the path between joints (6,) is furthest outside the box; None when never by more than `slack_mm`."""
    points = flange_path_mm(arm, start_rad, end_rad)
    outside = box.outside_mm(points)
    worst = int(outside.argmax())
    if outside[worst] <= slack_mm:
        return None
    return OutsideBox(worst / (len(points) - 1), points[worst], float(outside[worst]))


def stay_in_box(arm: Arm, start_rad: Array, ends_rad: Array, box: Box, slack_mm: float = 0.0) -> NDArray[np.bool_]:
    """Mask (n,) of the joints (n, 6) to which the path is never outside the box by more than `slack_mm`."""
    outside = box.outside_mm(flange_path_mm(arm, start_rad, ends_rad))
    return np.asarray(np.all(outside <= slack_mm, axis=-1))


def _steps(arm: Arm, travel_rad: Array) -> int:
    """Number of steps for the longest of the travels (..., 6).

    The chord error of a curve p(t), 0 <= t <= 1, in n equal steps is at most max|p''| / (8 n²). With the distances
    that the flange can have from axes 1 to 3 (the whole arm) and from axes 4 and 5 (wrist to flange; axis 6 passes
    through its origin), |p''| <= sum of distance_ij |travel_i travel_j|, where the outer axis decides distance_ij.
    """
    travel = np.abs(travel_rad)
    inner, wrist = travel[..., :3].sum(-1), travel[..., 3:5].sum(-1)
    curved_mm = (arm.reach_mm + arm.flange_mm) * inner**2 + arm.flange_mm * (2 * inner * wrist + wrist**2)
    steps = np.maximum(np.sqrt(curved_mm / (8 * MAX_CHORD_ERROR_MM)), travel.max(-1) / MAX_STEP_RAD)
    return max(1, int(np.ceil(steps.max(initial=0.0))))
