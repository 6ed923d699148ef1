"""Reprojection residuals and derivatives of all views, summed to one normal matrix for each view.

Residuals are predicted minus measured pixels; their derivatives are by the view's pose (6: exp(.) @ camera_T_target,
[rotation rad, translation mm]) and, when they are free, by the intrinsics (9: fx fy cx cy k1 k2 p1 p2 k3; 12 with k4 k5
k6; of a fisheye k1 to k4 follow cy) and by changes of the target's shape. `free_intrinsics` selects the 9, none, or
some of them (9,) or (12,); `shape_modes` (n, m, 3, s) are the displacements of the points, in the target's frame, by
one unit of each of s changes.
All views are one padded batch, so that the number of array operations does not depend on the number of views.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from calibration.observations.observations import Observations
from calibration.transforms import Array, map_points

INTRINSICS = 9
RATIONAL_INTRINSICS = 12
MIN_DEPTH_MM = 1e-3
"""A point at or behind the camera is moved to this depth; its large residual then moves it back in front."""


@dataclass(frozen=True, eq=False)
class PixelStatistics:
    """[J, r]' [J, r] (n, k + 1, k + 1) and the number of residuals (n,) of each view; k is 6 to 16."""

    sums: Array
    count: Array

    @property
    def normal(self) -> Array:
        """J' J (n, k, k)"""
        return self.sums[:, :-1, :-1]

    @property
    def gradient(self) -> Array:
        """J' r (n, k)"""
        return self.sums[:, :-1, -1]

    @property
    def square(self) -> Array:
        """r' r (n,)"""
        return self.sums[:, -1, -1]


def pixel_residuals(seen: Observations, camera: CameraModel, camera_T_target: Array) -> Array:
    """Predicted minus measured pixels (n, m, 2), at poses camera_T_target (n, 4, 4)."""
    points = map_points(camera_T_target, seen.points_mm)
    points[..., 2] = np.maximum(points[..., 2], MIN_DEPTH_MM)
    return camera.project(points.reshape(-1, 3)).reshape(seen.pixels.shape) - seen.pixels


def pixel_statistics(
    seen: Observations,
    camera: CameraModel,
    camera_T_target: Array,
    *,
    free_intrinsics: bool | NDArray[np.bool_] = False,
    shape_modes: Array | None = None,
) -> PixelStatistics:
    """The sums of every view at the poses camera_T_target (n, 4, 4)."""
    columns = pixel_columns(seen, camera, camera_T_target, free_intrinsics=free_intrinsics, shape_modes=shape_modes)
    columns = columns.reshape(*columns.shape[:2], 2 * columns.shape[3])
    count = 2 * np.count_nonzero(seen.weights, axis=1).astype(float)
    return PixelStatistics(columns @ np.swapaxes(columns, 1, 2), count)


def pixel_columns(
    seen: Observations,
    camera: CameraModel,
    camera_T_target: Array,
    *,
    free_intrinsics: bool | NDArray[np.bool_] = False,
    shape_modes: Array | None = None,
) -> Array:
    """Derivatives and, last, residual of every pixel coordinate, times the root of its weight: (n, k + 1, 2, m).

    Every derivative is contiguous in memory, for speed.
    """
    arms = camera_T_target[:, :3, :3] @ np.swapaxes(seen.points_mm, 1, 2)
    x, y, z = np.moveaxis(arms + camera_T_target[:, :3, 3:], 1, 0)
    z = np.maximum(z, MIN_DEPTH_MM)
    u, v = x / z, y / z
    chosen = np.flatnonzero(
        np.broadcast_to(free_intrinsics, INTRINSICS) if free_intrinsics is True else free_intrinsics
    )
    shapes = 0 if shape_modes is None else shape_modes.shape[-1]
    columns = np.empty((len(x), 6 + len(chosen) + shapes + 1, 2, x.shape[1]))
    (fx, skew, cx), (_, fy, cy), _ = camera.matrix
    xx, xy, yx, yy = camera.lens.slopes(u, v)
    # With (a, b, c) = d pixel / d point, the derivative by a rotation of the point p is p × (a, b, c), by a shift it.
    for row, (along_u, along_v) in enumerate(((fx * xx + skew * yx, fx * xy + skew * yy), (fy * yx, fy * yy))):
        a, b = along_u / z, along_v / z
        c = -(a * u + b * v)
        columns[:, 0, row] = y * c - z * b
        columns[:, 1, row] = z * a - x * c
        columns[:, 2, row] = x * b - y * a
        columns[:, 3, row], columns[:, 4, row], columns[:, 5, row] = a, b, c
    along, across = camera.lens.distort(u, v)
    for column, slopes in enumerate(_by_intrinsics(chosen, camera, u, v, along, across), start=6):
        columns[:, column, 0], columns[:, column, 1] = slopes
    if shape_modes is not None:
        moved = np.einsum("nij,nmjs->nsim", camera_T_target[:, :3, :3], shape_modes)
        for mode in range(shapes):
            columns[:, mode - shapes - 1] = (columns[:, 3:6] * moved[:, mode, :, None]).sum(axis=1)
    columns[:, -1, 0] = fx * along + skew * across + cx - seen.pixels[..., 0]
    columns[:, -1, 1] = fy * across + cy - seen.pixels[..., 1]
    if not np.all(seen.weights == 1.0):
        columns *= np.sqrt(seen.weights)[:, None, None]
    return columns


def _by_intrinsics(
    chosen: NDArray[np.intp], camera: CameraModel, x: Array, y: Array, along: Array, across: Array
) -> Iterator[tuple[Array | float, Array | float]]:
    """Derivatives of both pixel coordinates by the `chosen` intrinsics, at ideal x, y and distorted along, across."""
    (fx, skew, _), (_, fy, _), _ = camera.matrix
    by_focal_and_centre = ((along, 0.0), (0.0, across), (1.0, 0.0), (0.0, 1.0))
    for which in chosen.tolist():
        if which < len(by_focal_and_centre):
            yield by_focal_and_centre[which]
        else:
            by_x, by_y = camera.lens.by_coefficient(which - len(by_focal_and_centre), x, y)
            yield fx * by_x + skew * by_y, fy * by_y


def with_intrinsics(camera: CameraModel, change: Array) -> CameraModel:
    """The camera with `change` (9,) or (12,) added to its intrinsics, as far as its lens has them."""
    matrix, distortion = camera.matrix.copy(), camera.distortion.copy()
    matrix[[0, 1, 0, 1], [0, 1, 2, 2]] += change[:4]
    count = min(len(distortion), len(change) - 4)
    distortion[:count] += change[4 : 4 + count]
    return replace(camera, matrix=matrix, distortion=distortion)
