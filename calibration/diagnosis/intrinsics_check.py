"""Test of the given intrinsics against those estimated from the same views, without the robot."""

from dataclasses import dataclass

import numpy as np
import scipy

from calibration.camera import BROWN, CameraModel
from calibration.diagnosis.evidence import pixel_deviation
from calibration.errors import UndeterminedError
from calibration.intrinsics.bundle_adjustment import adjust
from calibration.intrinsics.estimate import estimate_camera
from calibration.linear_algebra import scaled_pseudo_inverse, scaled_solve
from calibration.observations.observations import Observations
from calibration.observations.reprojection import INTRINSICS, RATIONAL_INTRINSICS, pixel_statistics
from calibration.observations.view_poses import candidate_poses, refine_poses
from calibration.problem import Problem
from calibration.transforms import Array

MAX_VIEWS = 40
"""Most views for the test; more add little."""

MIN_VIEWS = 5
MIN_REPORTED_SHARE = 5e-4
"""Least shift of the target by better intrinsics, over its distance, that is reported. A new calibration of the same
camera at another temperature differs by less."""

MIN_REPORTED_RATIO = 1.1
"""Least ratio of the pixel deviations before and after that is reported."""

MIN_GROSS_SIGMAS = 5.0
"""Least difference of the focal lengths, in its standard deviations, for intrinsics of the views alone."""

MAX_RATIO_TO_SHAPE = 1.02
"""Largest ratio of the pixel deviation with other intrinsics to that with another target shape for preferring them."""


@dataclass(frozen=True, eq=False)
class LensMisfit:
    """Intrinsics that fit, the views' poses with them (n, 4, 4), and the pixels' deviation before and after.

    `share`: shift of the target over its distance, in the median view; `significant`: reported by itself.
    """

    camera: CameraModel
    camera_T_target: Array
    before_px: float
    after_px: float
    share: float
    significant: bool


def lens_misfit(
    seen: Observations, camera: CameraModel, camera_T_target: Array, max_p_value: float, otherwise_px: float = np.inf
) -> LensMisfit | None:
    """The misfit when other intrinsics fit better with a p value up to `max_p_value`, else None.

    `otherwise_px`: pixel deviation under the alternative explanation, another shape of the target.
    """
    if len(seen) < MIN_VIEWS:
        return None
    rows = np.unique(np.linspace(0, len(seen) - 1, MAX_VIEWS).astype(np.intp))
    few, poses = seen.take(rows), camera_T_target[rows]
    if _step_p_value(few, camera, poses) > max_p_value:
        return None
    found = adjust(few, camera, poses, np.ones(RATIONAL_INTRINSICS, bool), _expected_lens(camera))
    before = pixel_deviation(pixel_statistics(few, camera, poses))
    after = pixel_deviation(pixel_statistics(few, found.camera, found.poses))
    by_chance = _p_value(few, before**2, after**2)
    moved = refine_poses(seen, found.camera, camera_T_target)
    shift = np.linalg.norm(moved[:, :3, 3] - camera_T_target[:, :3, 3], axis=1)
    share = float(np.median(shift / np.linalg.norm(camera_T_target[:, :3, 3], axis=1)))
    if by_chance > max_p_value or after > MAX_RATIO_TO_SHAPE * otherwise_px:
        return None
    # The shift along the axis is as uncertain as the focal length.
    focal_sigma = float(np.sqrt(found.covariance[0, 0]) / found.camera.matrix[0, 0])
    significant = share > max(MIN_REPORTED_SHARE, focal_sigma) or before > MIN_REPORTED_RATIO * after
    return LensMisfit(found.camera, moved, before, after, share, significant)


def _expected_lens(camera: CameraModel) -> Array | None:
    """The given coefficients, when they are not Brown's: those of rational lenses may be of any size."""
    brown = camera.lens_model == "pinhole" and len(camera.distortion) <= BROWN
    return None if brown else camera.distortion


def gross_lens_misfit(problem: Problem, seen: Observations, otherwise_px: float = np.inf) -> LensMisfit | None:
    """The misfit in the views `seen` of intrinsics so wrong that no step leads from them to those that fit.

    None when the views do not determine intrinsics, or these do not fit clearly better.
    """
    given = problem.camera
    detections = [view.detection for view in problem.views if view.detection is not None]
    if given is None or given.lens_model != "pinhole" or len(detections) < MIN_VIEWS:
        return None
    few = [detections[row] for row in np.unique(np.linspace(0, len(detections) - 1, MAX_VIEWS).astype(np.intp))]
    try:
        found = estimate_camera(problem.target, few, problem.image_size)
    except UndeterminedError:
        return None
    focal, given_focal = found.camera.matrix[0, 0], given.matrix[0, 0]
    if abs(given_focal / focal - 1) < MIN_GROSS_SIGMAS * np.sqrt(found.covariance[0, 0]) / focal:
        return None
    before, after = (
        pixel_deviation(pixel_statistics(seen, camera, candidate_poses(seen, camera)[0][:, 0]))
        for camera in (given, found.camera)
    )
    if before < MIN_REPORTED_RATIO * after or after > MAX_RATIO_TO_SHAPE * otherwise_px:
        return None
    poses = candidate_poses(seen, found.camera)[0][:, 0]
    return LensMisfit(found.camera, poses, before, after, abs(float(given_focal / focal) - 1), True)


def _step_p_value(seen: Observations, camera: CameraModel, poses: Array) -> float:
    """p value of one linear step of the intrinsics: a score test, which needs one evaluation of the pixels."""
    sums = pixel_statistics(seen, camera, poses, free_intrinsics=True)
    coupling, gradient = sums.normal[:, :6, 6:], sums.gradient[:, :6, None]
    solved = scaled_solve(sums.normal[:, :6, :6], np.concatenate([coupling, gradient], axis=2))
    across = np.swapaxes(coupling, 1, 2) @ solved
    information = (sums.normal[:, 6:, 6:] - across[:, :, :-1]).sum(axis=0)
    score = (sums.gradient[:, 6:] - across[:, :, -1]).sum(axis=0)
    promised = score @ scaled_pseudo_inverse(information, 1e-10) @ score
    before = pixel_deviation(sums) ** 2
    redundancy = max(float(sums.count.sum()) - 6 * len(seen), 1.0)
    left = max(1 - float(promised) / (before * redundancy), 1e-6)
    return _p_value(seen, before, before * left)


def _p_value(seen: Observations, before: float, after: float) -> float:
    """Probability that nine more unknowns lower the pixels' variance as far without a fault (Fisher's F)."""
    numbers = 2 * int(np.count_nonzero(seen.weights)) - 6 * len(seen)
    left = max(numbers - INTRINSICS, 1)
    ratio = max(before / after - 1, 0.0) * left / INTRINSICS
    return float(scipy.special.fdtrc(INTRINSICS, left, ratio))
