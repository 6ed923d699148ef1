"""Rejection of outlying corners, and of views in which too many corners are outliers."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from calibration.observations.observations import MIN_CORNERS, Observations
from calibration.observations.reprojection import pixel_residuals
from calibration.observations.view_poses import candidate_poses, refine_poses
from calibration.transforms import Array

OUTLIER_SIGMA = 6.0
"""Outlier threshold in standard deviations of the view; a normal corner exceeds it once in 60 million."""

MAX_SCATTER_RATIO = 6.0
"""A view is refused when its corners scatter this many times more than those of the median view."""

MIN_SCALE_PX = 1e-3
"""Floor of the standard deviation of a corner; simulated corners can be exact."""

MIN_VIEW_SCATTER_PX = 5e-3
"""The same of a whole view's corners: no detector does better in a photograph (`benchmarks.detection`, bound)."""

MIN_KEPT_SHARE = 0.6
"""A view is refused when less than this share of its corners remains."""

ITERATIONS = 8
CAUCHY_TUNING = 2.3849
"""Cauchy's tuning constant for 95 % efficiency at the normal distribution (P. Holland & R. Welsch, 1977)."""


@dataclass(frozen=True, eq=False)
class CleanCorners:
    """The observations without outlying corners, each view's pose (n, 4, 4), and the rows of the refused views."""

    seen: Observations
    camera_T_target: Array
    refused: NDArray[np.intp]


def reject_corner_outliers(seen: Observations, camera: CameraModel, camera_T_target: Array) -> CleanCorners:
    """Reject outliers, from the least-squares poses (n, 4, 4); views without an outlier keep weights and pose."""
    poses = camera_T_target.copy()
    distances = _distances(seen, camera, poses)
    suspect = np.flatnonzero(np.max(distances * (seen.weights > 0), axis=1) > OUTLIER_SIGMA * _scale(distances, seen))
    weights = seen.weights.copy()
    if len(suspect):
        weights[suspect], poses[suspect] = _refit_robustly(seen.take(suspect), camera)
    cleaned = seen.with_weights(weights)
    return CleanCorners(cleaned, poses, _disagreeing_views(seen, cleaned, camera, poses))


def _refit_robustly(views: Observations, camera: CameraModel) -> tuple[Array, Array]:
    """Weights (n, m) of 0 or 1 and refitted poses: a majority first, then Cauchy weights, a hard limit at the end."""
    present = views.weights > 0
    majority = np.array([_majority_weights(views, camera, row) for row in range(len(views))])
    poses = candidate_poses(views.with_weights(majority), camera)[0][:, 0]
    for _ in range(ITERATIONS):
        distances = _distances(views, camera, poses)
        ratio = distances / (CAUCHY_TUNING * _scale(distances, views)[:, None])
        poses = refine_poses(views.with_weights(present / (1 + ratio**2)), camera, poses, iterations=2)
    distances = _distances(views, camera, poses)
    weights = (present & (distances <= OUTLIER_SIGMA * _scale(distances, views)[:, None])).astype(float)
    weights[weights.sum(axis=1) < MIN_CORNERS] = views.weights[weights.sum(axis=1) < MIN_CORNERS]
    return weights, refine_poses(views.with_weights(weights), camera, poses)


def _majority_weights(views: Observations, camera: CameraModel, row: int) -> Array:
    """Weights (m,) of the corners that agree on one homography (least median of squares), at least four of them."""
    present = np.flatnonzero(views.weights[row] > 0)
    xy = camera.normalise(views.pixels[row, present])
    sane = np.all(np.isfinite(xy), axis=1)
    present, xy = present[sane], xy[sane]
    weights = np.zeros(len(views.weights[row]))
    if len(present) > MIN_CORNERS:
        # In units of a pixel: OpenCV's smallest deviation is an absolute number.
        undistorted_px = xy * camera.matrix[0, 0]
        _, agreeing = cv2.findHomography(views.points_mm[row, present, :2], undistorted_px, cv2.LMEDS)
        chosen = present[agreeing[:, 0] > 0] if agreeing is not None else present[:0]
        weights[chosen] = 1.0
    return weights if np.count_nonzero(weights) >= MIN_CORNERS else views.weights[row]


def _disagreeing_views(
    seen: Observations, cleaned: Observations, camera: CameraModel, poses: Array
) -> NDArray[np.intp]:
    distances = _distances(cleaned, camera, poses)
    scale = np.sqrt((cleaned.weights * distances**2).sum(axis=1) / np.maximum(2 * cleaned.weights.sum(axis=1) - 6, 1.0))
    lost = cleaned.weights.sum(axis=1) < MIN_KEPT_SHARE * (seen.weights > 0).sum(axis=1)
    limit = MAX_SCATTER_RATIO * max(float(np.median(scale)), MIN_VIEW_SCATTER_PX)
    return np.flatnonzero(lost | (scale > limit))


def _distances(seen: Observations, camera: CameraModel, poses: Array) -> Array:
    distances: Array = np.linalg.norm(pixel_residuals(seen, camera, poses), axis=-1)
    return distances


def _scale(distances: Array, seen: Observations) -> Array:
    """Standard deviation of a coordinate in each view (n,), from the median distance (Rayleigh: 1.1774 deviations).

    Corrected for the six fitted parameters of each view, and at least that of the median view.
    """
    count = (seen.weights > 0).sum(axis=1)
    median = np.nanmedian(np.where(seen.weights > 0, distances, np.nan), axis=1) / 1.1774
    scale: Array = median * np.sqrt(2 * count / np.maximum(2 * count - 6, 1))
    return np.maximum(scale, max(float(np.median(scale)), MIN_SCALE_PX))
