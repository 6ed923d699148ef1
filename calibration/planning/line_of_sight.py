"""Check that an arm does not stand between a camera beside the robot and the target on its flange."""

from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from calibration.kinematics.arm import Arm
from calibration.problem import Setup
from calibration.targets import Target
from calibration.transforms import Array, map_points

ARM_RADIUS_MM = 120.0
"""Around the lines from axis to axis; the arms known here are 100 to 250 mm thick."""

EPSILON = 1e-12
"""Below it a squared length or the square of a sine counts as zero."""

NEAR_TARGET_MM = 200.0
"""The last part of a line of sight, in which hand and wrist are: the target faces the camera, so they are behind it."""


@dataclass(frozen=True, eq=False)
class LineOfSight:
    """`camera_mm` (3,) in the base; `target_mm` (n, 3) on the flange: the target's corners and its middle."""

    camera_mm: Array
    target_mm: Array

    def is_clear(self, arm: Arm, joints_rad: Array) -> NDArray[np.bool_]:
        """Mask (...) of joints (..., 6): no link from the base to the wrist is nearer than ARM_RADIUS_MM to a line."""
        links = arm.skeleton(joints_rad)[..., :3, :]
        foot = np.zeros((*links.shape[:-2], 1, 3))
        links = np.concatenate([foot, links], axis=-2)
        flange = arm.forward(joints_rad)
        ends = self.target_mm @ np.swapaxes(flange[..., :3, :3], -1, -2) + flange[..., None, :3, 3]
        rays = ends - self.camera_mm
        length = np.linalg.norm(rays, axis=-1, keepdims=True)
        ends = self.camera_mm + rays * np.maximum(1 - NEAR_TARGET_MM / np.maximum(length, EPSILON), 0.0)
        apart = distance_of_segments(
            links[..., :-1, None, :], links[..., 1:, None, :], self.camera_mm, ends[..., None, :, :]
        )
        return np.asarray(apart.min(axis=(-1, -2)) >= ARM_RADIUS_MM)


def line_of_sight(setup: Setup, target: Target, mount_T_camera: Array, anchor_T_target: Array) -> LineOfSight | None:
    """From the poses (4, 4) of camera and target; None for a camera on the flange, which no link can hide from."""
    if setup == "eye-in-hand":
        return None
    low, high = target.points_mm.min(axis=0), target.points_mm.max(axis=0)
    (x0, y0, _), (x1, y1, _) = low, high
    seen = np.array([[x0, y0, 0], [x1, y0, 0], [x1, y1, 0], [x0, y1, 0], (low + high) / 2])
    return LineOfSight(mount_T_camera[:3, 3], map_points(anchor_T_target, seen))


def distance_of_segments(a_mm: Array, b_mm: Array, c_mm: Array, d_mm: Array) -> Array:
    """Least distance (...) between the segments from a to b and from c to d (..., 3).

    Where both nearest points lie within, of the lines; else of an end from the other segment.
    """
    u, v, w = b_mm - a_mm, d_mm - c_mm, a_mm - c_mm
    uu, uv, vv = (u * u).sum(-1), (u * v).sum(-1), (v * v).sum(-1)
    uw, vw = (u * w).sum(-1), (v * w).sum(-1)
    across = uu * vv - uv * uv
    with np.errstate(divide="ignore", invalid="ignore"):
        s, t = (uv * vw - vv * uw) / across, (uu * vw - uv * uw) / across
    within = (across > EPSILON * uu * vv) & (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
    s, t = (np.where(within, share, 0.0)[..., None] for share in (s, t))
    ends = ((a_mm, c_mm, v), (b_mm, c_mm, v), (c_mm, a_mm, u), (d_mm, a_mm, u))
    from_ends = reduce(np.minimum, [_from_segment(*end) for end in ends])
    nearest: Array = np.where(within, np.linalg.norm(w + s * u - t * v, axis=-1), from_ends)
    return nearest


def _from_segment(point_mm: Array, start_mm: Array, along_mm: Array) -> Array:
    """Distance of a point from the segment from `start_mm` to `start_mm + along_mm`."""
    from_start = point_mm - start_mm
    squared = np.maximum((along_mm * along_mm).sum(-1), EPSILON)
    share = np.clip((from_start * along_mm).sum(-1) / squared, 0.0, 1.0)
    distance: Array = np.linalg.norm(from_start - share[..., None] * along_mm, axis=-1)
    return distance
