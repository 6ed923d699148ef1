"""Places of the flange in a box of the base, and the joints that bring it there."""

import numpy as np

from calibration.kinematics.arm import Arm, UnreachablePoseError
from calibration.transforms import Array, transform

BOX_SHARE_OF_REACH = 0.15
"""The box around views goes so far beyond the places of the flange, on each side."""


def box_around(arm: Arm, joints_rad: Array) -> Array:
    """Least and largest corner (2, 3), mm, of the box around the flange at joints (n, 6)."""
    places, margin = arm.forward(joints_rad)[:, :3, 3], BOX_SHARE_OF_REACH * arm.reach_mm
    box: Array = np.array([places.min(axis=0) - margin, places.max(axis=0) + margin]).round()
    return box


def middle_of(joints_rad: Array) -> Array:
    """Of joints (n, 6) those (6,) nearest to their mean."""
    middle: Array = joints_rad[np.argmin(np.linalg.norm(joints_rad - joints_rad.mean(axis=0), axis=1))]
    return middle


def grid_in(box_mm: Array, steps: int) -> Array:
    """Places (steps³, 3) in a box (2, 3), its corners among them."""
    edges = [np.linspace(low, high, steps) for low, high in box_mm.T]
    grid: Array = np.stack(np.meshgrid(*edges, indexing="ij"), axis=-1).reshape(-1, 3)
    return grid


def joints_at_places(arm: Arm, middle: Array, places: Array, seen: tuple[Array, Array]) -> Array:
    """Joints (n, 6) that bring the flange to the places within reach (of (m, 3)), turned as at `middle` (6,)."""
    turned = arm.forward(middle)[:3, :3]
    return joints_within_reach(arm, transform(np.broadcast_to(turned, (len(places), 3, 3)), places), seen)


def joints_within_reach(arm: Arm, base_T_flange: Array, seen: tuple[Array, Array]) -> Array:
    """Joints (n, 6) of the poses within reach (of (m, 4, 4)), least outside the range `seen` (lowest, highest)."""
    found = []
    for pose in base_T_flange:
        try:
            found.append(arm.nearest_to_range(pose, *seen))
        except UnreachablePoseError:
            continue
    return np.array(found).reshape(-1, 6)
