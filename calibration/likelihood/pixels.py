"""What the pixels of every view say, condensed to one small matrix a view.

Residuals are predicted minus measured pixels; their derivatives are by the view's pose (6: exp(.) @ camera_T_target,
[rotation rad, translation mm]) and, when they are free, by the intrinsics (9: fx fy cx cy k1 k2 p1 p2 k3) and by the
target's relative scale (1).
All views are one padded batch, so the cost is a few array operations however many views there are.
"""

from dataclasses import dataclass

import numpy as np

from calibration.camera import CameraModel
from calibration.observations import Observations
from calibration.transforms import Array, map_points

INTRINSICS = 9
NEAREST_MM = 1e-3
"""A point at or behind the camera is treated as this near: its enormous residual drives it back."""


@dataclass(frozen=True, eq=False)
class PixelStatistics:
    """J' J (n, k, k), J' r (n, k), r' r (n,) and the number of residuals (n,) of each view; k = 6 or 15."""

    normal: Array
    gradient: Array
    square: Array
    count: Array


def pixel_residuals(seen: Observations, camera: CameraModel, camera_T_target: Array) -> Array:
    """Predicted minus measured (n, m, 2), in px."""
    points = _in_front(map_points(camera_T_target, seen.points_mm))
    return camera.project(points.reshape(-1, 3)).reshape(seen.pixels.shape) - seen.pixels


def pixel_statistics(
    seen: Observations,
    camera: CameraModel,
    camera_T_target: Array,
    *,
    free_intrinsics: bool = False,
    free_scale: bool = False,
) -> PixelStatistics:
    """The sums of every view at the given poses (n, 4, 4)."""
    rows = pixel_rows(seen, camera, camera_T_target, free_intrinsics=free_intrinsics, free_scale=free_scale)
    rows = rows.reshape(len(seen), -1, rows.shape[-1])
    sums = np.swapaxes(rows, 1, 2) @ rows
    count = 2 * np.count_nonzero(seen.weights, axis=1).astype(float)
    return PixelStatistics(sums[:, :-1, :-1], sums[:, :-1, -1], sums[:, -1, -1], count)


def pixel_rows(
    seen: Observations,
    camera: CameraModel,
    camera_T_target: Array,
    *,
    free_intrinsics: bool = False,
    free_scale: bool = False,
) -> Array:
    """Derivatives and, last, residual of every pixel coordinate, times the root of its weight: (n, m, 2, k + 1)."""
    points = _in_front(map_points(camera_T_target, seen.points_mm))
    n, m = points.shape[:2]
    flat = points.reshape(-1, 3)
    xy = flat[:, :2] / flat[:, 2:]
    rows = np.empty((n * m, 2, 6 + (INTRINSICS if free_intrinsics else 0) + free_scale + 1))
    rows[:, :, :6] = _by_pose(camera, flat, xy)
    if free_intrinsics:
        rows[:, :, 6 : 6 + INTRINSICS] = _by_intrinsics(camera, xy)
    if free_scale:
        arms = (points - camera_T_target[:, None, :3, 3]).reshape(-1, 3, 1)
        rows[:, :, -2] = (rows[:, :, 3:6] @ arms)[..., 0]
    rows[:, :, -1] = _pixels_of(camera, xy) - seen.pixels.reshape(-1, 2)
    if not np.all(seen.weights == 1.0):
        rows *= np.sqrt(seen.weights).reshape(-1, 1, 1)
    return rows.reshape(n, m, 2, -1)


def _in_front(points: Array) -> Array:
    points[..., 2] = np.maximum(points[..., 2], NEAREST_MM)
    return points


def _pixels_of(camera: CameraModel, xy: Array) -> Array:
    (fx, skew, cx), (_, fy, cy), _ = camera.matrix
    x, y = camera.distort(xy).T
    return np.column_stack([fx * x + skew * y + cx, fy * y + cy])


def _by_pose(camera: CameraModel, points: Array, xy: Array) -> Array:
    """(k, 2, 6): with a = d pixel / d point, the derivative by a rotation of the point p is p × a, by a shift a."""
    by_xy = camera.matrix[:2, :2] @ camera.distortion_jacobian(xy) / points[:, 2, None, None]
    rows = np.empty((len(points), 2, 6))
    rows[:, :, 3:5] = by_xy
    rows[:, :, 5] = -(by_xy @ xy[:, :, None])[:, :, 0]
    x, y, z = (points[:, None, axis] for axis in range(3))
    a, b, c = rows[:, :, 3], rows[:, :, 4], rows[:, :, 5]
    rows[:, :, 0] = y * c - z * b
    rows[:, :, 1] = z * a - x * c
    rows[:, :, 2] = x * b - y * a
    return rows


def _by_intrinsics(camera: CameraModel, xy: Array) -> Array:
    """(k, 2, 9)"""
    fx, fy = camera.matrix[0, 0], camera.matrix[1, 1]
    x, y = xy.T
    r2 = x * x + y * y
    distorted = camera.distort(xy)
    rows = np.zeros((len(xy), 2, INTRINSICS))
    rows[:, 0, 0], rows[:, 1, 1] = distorted[:, 0], distorted[:, 1]
    rows[:, 0, 2] = rows[:, 1, 3] = 1.0
    rows[:, 0, 4:] = fx * np.column_stack([x * r2, x * r2 * r2, 2 * x * y, r2 + 2 * x * x, x * r2 * r2 * r2])
    rows[:, 1, 4:] = fy * np.column_stack([y * r2, y * r2 * r2, r2 + 2 * y * y, 2 * x * y, y * r2 * r2 * r2])
    return rows


def with_intrinsics(camera: CameraModel, change: Array) -> CameraModel:
    """The camera with its nine intrinsics changed by (9,)."""
    matrix = camera.matrix.copy()
    matrix[[0, 1, 0, 1], [0, 1, 2, 2]] += change[:4]
    return CameraModel(matrix, camera.distortion + change[4:], camera.image_size)
