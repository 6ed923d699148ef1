"""Estimation of a camera's intrinsics from detections of one target.

Lens coefficients that do not differ significantly from zero are set to zero, the rational lens of eight coefficients
is taken where the data support it, outlying views and points are left out, and views that do not determine the focal
length are refused.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from calibration.errors import UndeterminedError
from calibration.intrinsics.bundle_adjustment import BundleFit, adjust, predicted_gain
from calibration.intrinsics.zhang_init import initial_camera, plane_views
from calibration.kinematics.stance import Stance
from calibration.observations.observations import Observations, observe
from calibration.observations.reprojection import INTRINSICS, RATIONAL_INTRINSICS, pixel_residuals, pixel_statistics
from calibration.observations.view_poses import candidate_poses, refine_poses
from calibration.problem import Detection, Problem, View
from calibration.sentences.sentence import Sentence
from calibration.targets import Target
from calibration.transforms import Array

MIN_VIEWS = 3
MAX_FOCAL_SIGMA_SHARE = 0.05
"""Largest standard deviation of the focal length over itself; more means that the views are nearly frontal."""
LENS_TERMS = {"k3": (8,), "p1, p2": (6, 7), "k2": (5,), "k1": (4,)}
"""Indices of the intrinsics, in the order in which the fit is tried without them."""
SIGNIFICANT_CHI2 = {1: 10.8, 2: 13.8}
"""Chi-square threshold at a false-alarm probability of 0.001, by the number of coefficients."""
OUTLIER_VIEW_OF_MEDIAN, OUTLIER_POINT_SIGMA = 4.0, 6.0
MIN_NOISE_PX = 0.03
"""Floor of the pixel noise in the outlier thresholds."""
MAX_ROUNDS = 5
EVERY = np.ones(RATIONAL_INTRINSICS, bool)
MIN_VARIANCE_RATIO = 1.02
"""Least ratio of the pixels' variances, in the views of the fit and in others, for eight lens coefficients."""


@dataclass(frozen=True, eq=False)
class CameraEstimate:
    """`covariance` (9, 9) of fx fy cx cy k1 k2 p1 p2 k3, 0 where fixed at 0; (12, 12) with k4 k5 k6, where the lens has
    them. `rms_px` per axis.

    `positions` (n,): indices of the detections used, with their `camera_T_target` (n, 4, 4).
    """

    camera: CameraModel
    covariance: Array
    rms_px: float
    positions: NDArray[np.intp]
    camera_T_target: Array


def estimate_camera(target: Target, detections: Sequence[Detection], image_size: tuple[int, int]) -> CameraEstimate:
    """Intrinsics from views of one target; `image_size` (width, height) in px.

    Raises UndeterminedError `too-few-views`, `no-tilt`.
    """
    views = tuple(View(index, Stance(np.eye(4)), detection) for index, detection in enumerate(detections))
    seen, _ = observe(Problem("eye-in-hand", target, None, image_size, views))
    planes = plane_views(seen, image_size)
    seen = seen.take(np.array([plane is not None for plane in planes], bool))
    _require_views(seen)
    camera = initial_camera([plane for plane in planes if plane is not None], image_size)
    free = np.zeros(RATIONAL_INTRINSICS, bool)
    free[:6] = True  # the first rounds only remove outliers; two radial coefficients suffice for that
    for _ in range(MAX_ROUNDS):
        fit = _best_poses(seen, camera, free)
        camera, kept = fit.camera, _without_outliers(seen, fit)
        if kept is None:
            break
        seen = kept
        _require_views(seen)
    free[6:INTRINSICS] = True
    whole = _best_poses(seen, camera, free)
    fit = _rational(seen, whole) or _without_insignificant(seen, whole, free)
    share = float(np.sqrt(fit.covariance[0, 0]) / fit.camera.matrix[0, 0])
    if not share <= MAX_FOCAL_SIGMA_SHARE:
        what = Sentence("no-tilt", percent=100 * share)
        raise UndeterminedError("no-tilt", what, Sentence("tilt-target"))
    return _estimate(seen, fit)


def _require_views(seen: Observations) -> None:
    if len(seen) < MIN_VIEWS:
        what = Sentence("too-few-views", views=len(seen), least=MIN_VIEWS)
        raise UndeterminedError("too-few-views", what, Sentence("take-tilted-views"))


def _best_poses(seen: Observations, camera: CameraModel, free: NDArray[np.bool_]) -> BundleFit:
    """The fit from the better of each view's two candidate poses, chosen once more with the camera of the first fit."""
    fit = adjust(seen, camera, candidate_poses(seen, camera)[0][:, 0], free)
    again = adjust(seen, fit.camera, candidate_poses(seen, fit.camera)[0][:, 0], free)
    return min(fit, again, key=lambda adjusted: adjusted.variance)


def _rational(seen: Observations, brown: BundleFit) -> BundleFit | None:
    """The fit with eight lens coefficients, when the data support it: by the Bayesian information criterion, by
    MIN_VARIANCE_RATIO, and in predicting views that were left out. A linear step is tried first."""
    count = 2 * float(np.count_nonzero(seen.weights))
    needed = 3 * float(np.log(count))
    start = _with_eight(brown.camera)
    if predicted_gain(seen, start, brown.poses, EVERY) < needed:
        return None
    fit = adjust(seen, start, brown.poses, EVERY)
    gain = count * float(np.log(max(brown.variance, 1e-300) / max(fit.variance, 1e-300)))
    if gain < needed or brown.variance < MIN_VARIANCE_RATIO * fit.variance:
        return None
    halves = [np.arange(len(seen)) % 2 == half for half in range(2)]
    errors = [_error_elsewhere(seen, brown, half, eight) for half in halves for eight in (False, True)]
    return fit if errors[0] + errors[2] > MIN_VARIANCE_RATIO * (errors[1] + errors[3]) else None


def _with_eight(camera: CameraModel) -> CameraModel:
    return replace(camera, distortion=np.concatenate([camera.distortion, np.zeros(3)]))


def _error_elsewhere(seen: Observations, brown: BundleFit, half: NDArray[np.bool_], eight: bool) -> float:
    """Sum of squared residuals of the other views, whose poses alone are refined, by the lens of one `half` of them."""
    start = _with_eight(brown.camera) if eight else brown.camera
    there = adjust(seen.take(half), start, brown.poses[half], EVERY).camera
    others = seen.take(~half)
    poses = refine_poses(others, there, brown.poses[~half])
    return float(pixel_statistics(others, there, poses).square.sum())


def _without_insignificant(seen: Observations, fit: BundleFit, free: NDArray[np.bool_]) -> BundleFit:
    """The fit with every lens term fixed at zero that does not differ significantly from it; `free` is updated."""
    for term in LENS_TERMS.values():
        index = list(term)
        values, block = fit.camera.distortion[np.array(index) - 4], fit.covariance[np.ix_(index, index)]
        if values @ np.linalg.pinv(block, hermitian=True) @ values < SIGNIFICANT_CHI2[len(index)]:
            free[index] = False
            distortion = np.where(free[4:INTRINSICS], fit.camera.distortion, 0.0)
            without = replace(fit.camera, distortion=distortion)
            fit = adjust(seen, without, fit.poses, free)
    return fit


def _without_outliers(seen: Observations, fit: BundleFit) -> Observations | None:
    """The observations without the worse half of the outlying views, else without outlying points; None if none."""
    distance = np.hypot(*np.moveaxis(pixel_residuals(seen, fit.camera, fit.poses), -1, 0))
    used = seen.weights > 0
    typical = np.array([np.median(row[mask]) for row, mask in zip(distance, used, strict=True)])
    stray_views = typical > OUTLIER_VIEW_OF_MEDIAN * max(float(np.median(typical)), MIN_NOISE_PX)
    if stray_views.any():
        return seen.take(typical < np.median(typical[stray_views]))
    noise_px = max(1.2 * float(np.median(distance[used])), MIN_NOISE_PX)
    stray_points = used & (distance > OUTLIER_POINT_SIGMA * noise_px)
    if not stray_points.any():
        return None
    weights = np.where(stray_points, 0.0, seen.weights)
    return seen.with_weights(weights).take((weights > 0).sum(axis=1) >= 4)


def _estimate(seen: Observations, fit: BundleFit) -> CameraEstimate:
    residual = pixel_residuals(seen, fit.camera, fit.poses) * np.sqrt(seen.weights)[..., None]
    square, count = (residual**2).sum(axis=(1, 2)), 2 * seen.weights.sum(axis=1)
    rms_px = float(np.sqrt(square.sum() / count.sum()))
    known = 4 + len(fit.camera.distortion)
    covariance = fit.covariance[:known, :known]
    return CameraEstimate(fit.camera, covariance, rms_px, seen.positions, fit.poses)
