"""Corners that do not belong: single ones are left out, and a view full of them is refused."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from calibration.observations.observations import FEWEST_CORNERS, Observations
from calibration.observations.reprojection import pixel_residuals
from calibration.observations.view_poses import candidate_poses, refined_poses
from calibration.transforms import Array

OUTLYING = 6.0
"""Deviations from its view: a normal corner is that far out once in 60 million."""

DISAGREEING = 6.0
"""A view whose corners scatter this many times more than the median view's is no picture of this target."""

SMALLEST_SCALE_PX = 1e-3
"""Simulated corners can be exact; the smallest error worth calling one."""

FEWEST_SHARE = 0.6
"""A view that loses more of its corners than this leaves has no majority to believe."""

ROUNDS = 8
TUKEY_SHARE = 2.3849
"""Cauchy's tuning constant for 95 % efficiency at the normal distribution (P. Holland & R. Welsch, 1977)."""


@dataclass(frozen=True, eq=False)
class CleanCorners:
    """The observations without outlying corners, each view's pose, and the rows whose view is refused."""

    seen: Observations
    camera_T_target: Array
    refused: NDArray[np.intp]


def without_bad_corners(seen: Observations, camera: CameraModel, camera_T_target: Array) -> CleanCorners:
    """From the least-squares poses (n, 4, 4); views without an outlying corner are not touched."""
    poses = camera_T_target.copy()
    distances = _distances(seen, camera, poses)
    suspect = np.flatnonzero(np.max(distances * (seen.weights > 0), axis=1) > OUTLYING * _scale(distances, seen))
    weights = seen.weights.copy()
    if len(suspect):
        weights[suspect], poses[suspect] = _rejected(seen.take(suspect), camera)
    cleaned = seen.weighted(weights)
    return CleanCorners(cleaned, poses, _disagreeing(seen, cleaned, camera, poses))


def _rejected(views: Observations, camera: CameraModel) -> tuple[Array, Array]:
    """Weights (n, m) of 0 or 1 and refitted poses: a majority first, then Cauchy weights, a hard limit at the end."""
    present = views.weights > 0
    majority = np.array([_majority(views, camera, row) for row in range(len(views))])
    poses = candidate_poses(views.weighted(majority), camera)[0][:, 0]
    for _ in range(ROUNDS):
        distances = _distances(views, camera, poses)
        ratio = distances / (TUKEY_SHARE * _scale(distances, views)[:, None])
        poses = refined_poses(views.weighted(present / (1 + ratio**2)), camera, poses, iterations=2)
    distances = _distances(views, camera, poses)
    weights = (present & (distances <= OUTLYING * _scale(distances, views)[:, None])).astype(float)
    weights[weights.sum(axis=1) < FEWEST_CORNERS] = views.weights[weights.sum(axis=1) < FEWEST_CORNERS]
    return weights, refined_poses(views.weighted(weights), camera, poses)


def _majority(views: Observations, camera: CameraModel, row: int) -> Array:
    """Weights (m,) of the corners that agree on one homography (least median of squares), at least four of them."""
    present = np.flatnonzero(views.weights[row] > 0)
    xy = camera.normalise(views.pixels[row, present])
    sane = np.all(np.isfinite(xy), axis=1)
    present, xy = present[sane], xy[sane]
    weights = np.zeros(len(views.weights[row]))
    if len(present) > FEWEST_CORNERS:
        # In units of a pixel: OpenCV's smallest deviation is an absolute number.
        undistorted_px = xy * camera.matrix[0, 0]
        _, agreeing = cv2.findHomography(views.points_mm[row, present, :2], undistorted_px, cv2.LMEDS)
        chosen = present[agreeing[:, 0] > 0] if agreeing is not None else present[:0]
        weights[chosen] = 1.0
    return weights if np.count_nonzero(weights) >= FEWEST_CORNERS else views.weights[row]


def _disagreeing(seen: Observations, cleaned: Observations, camera: CameraModel, poses: Array) -> NDArray[np.intp]:
    distances = _distances(cleaned, camera, poses)
    scale = np.sqrt((cleaned.weights * distances**2).sum(axis=1) / np.maximum(2 * cleaned.weights.sum(axis=1) - 6, 1.0))
    lost = cleaned.weights.sum(axis=1) < FEWEST_SHARE * (seen.weights > 0).sum(axis=1)
    limit = DISAGREEING * max(float(np.median(scale)), SMALLEST_SCALE_PX)
    return np.flatnonzero(lost | (scale > limit))


def _distances(seen: Observations, camera: CameraModel, poses: Array) -> Array:
    distances: Array = np.linalg.norm(pixel_residuals(seen, camera, poses), axis=-1)
    return distances


def _scale(distances: Array, seen: Observations) -> Array:
    """Standard deviation of a coordinate in each view (n,), from the median distance (Rayleigh: 1.1774 deviations).

    Six numbers were fitted to each view, which makes residuals smaller than errors; and a view is not believed to be
    much better than the median view.
    """
    count = (seen.weights > 0).sum(axis=1)
    median = np.nanmedian(np.where(seen.weights > 0, distances, np.nan), axis=1) / 1.1774
    scale: Array = median * np.sqrt(2 * count / np.maximum(2 * count - 6, 1))
    return np.maximum(scale, max(float(np.median(scale)), SMALLEST_SCALE_PX))
