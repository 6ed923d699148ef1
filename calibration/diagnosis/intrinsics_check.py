"""Test of the given intrinsics against those estimated from the same views, without the robot."""

from dataclasses import dataclass, replace
from math import gcd

import numpy as np

from calibration.camera import BROWN, CameraModel
from calibration.diagnosis.evidence import pixel_deviation
from calibration.errors import UndeterminedError
from calibration.intrinsics.bundle_adjustment import adjust
from calibration.intrinsics.estimate import CameraEstimate, estimate_camera
from calibration.likelihood.distributions import f_tail
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

MAX_CENTRE_OFF = 0.1
"""Most distance of a principal point from the picture's middle, as a share of the picture's size: two deviations of
`bundle_adjustment.CENTRE_SIGMA_OF_SIZE`. Beyond it the intrinsics may be those of pictures of another size."""

SIMPLE_RATIOS = tuple(p / q for both in range(2, 18) for p in range(1, both) if gcd(p, q := both - p) == 1)
"""Ratios of the sizes of two pictures of one camera, the simplest first."""

MAX_OFF_CENTRED = 1.3
"""Largest ratio of such a scale to the one that puts the principal point into the middle."""

MAX_RATIO_TO_FREE, MIN_FREE_PX = 2.0, 0.05
"""Largest ratio of the pixel deviation with scaled intrinsics to that with free ones, of at least so much: beyond it
the camera is another one."""


@dataclass(frozen=True, eq=False)
class LensMisfit:
    """Intrinsics that fit, the views' poses with them (n, 4, 4), and the pixels' deviation before and after.

    `share`: shift of the target over its distance, in the median view; `significant`: reported by itself.
    `covariance`: of the intrinsics by the images, see `CameraEstimate`; None where they are scaled ones.
    """

    camera: CameraModel
    camera_T_target: Array
    before_px: float
    after_px: float
    share: float
    significant: bool
    covariance: Array | None = None


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
    brown = camera.lens_model == "pinhole" and len(camera.distortion) <= BROWN
    expected = None if brown else camera.distortion  # coefficients of rational lenses may be of any size
    found = adjust(few, camera, poses, np.ones(RATIONAL_INTRINSICS, bool), expected)
    before = pixel_deviation(pixel_statistics(few, camera, poses))
    after = pixel_deviation(pixel_statistics(few, found.camera, found.poses))
    by_chance = _p_value(few, before**2, after**2)
    shift = np.linalg.norm(found.poses[:, :3, 3] - poses[:, :3, 3], axis=1)
    share = float(np.median(shift / np.linalg.norm(poses[:, :3, 3], axis=1)))
    if by_chance > max_p_value or after > MAX_RATIO_TO_SHAPE * otherwise_px:
        return None
    # The shift along the axis is as uncertain as the focal length.
    focal_sigma = float(np.sqrt(found.covariance[0, 0]) / found.camera.matrix[0, 0])
    significant = share > max(MIN_REPORTED_SHARE, focal_sigma) or before > MIN_REPORTED_RATIO * after
    moved = refine_poses(seen, found.camera, camera_T_target)
    return LensMisfit(found.camera, moved, before, after, share, significant, found.covariance)


def fits_better(misfit: LensMisfit, seen: Observations, camera: CameraModel, poses: Array, max_p_value: float) -> bool:
    """Whether the intrinsics of the misfit fit better than another `camera` about these `poses` (n, 4, 4), with a p
    value up to `max_p_value`; `seen`: with the target's points that go with that camera."""
    rows = np.unique(np.linspace(0, len(seen) - 1, MAX_VIEWS).astype(np.intp))
    few = seen.take(rows)
    there = pixel_deviation(pixel_statistics(few, camera, refine_poses(few, camera, poses[rows])))
    return _p_value(few, there**2, misfit.after_px**2) <= max_p_value


def gross_lens_misfit(problem: Problem, seen: Observations, otherwise_px: float = np.inf) -> LensMisfit | None:
    """The misfit in the views `seen` of intrinsics so wrong that no step leads from them to those that fit.

    None when the views do not determine intrinsics, or these do not fit clearly better.
    """
    given = problem.camera
    if given is None or given.lens_model != "pinhole" or (found := free_camera(problem)) is None:
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
    share = abs(float(given_focal / focal) - 1)
    return LensMisfit(found.camera, poses, before, after, share, True, found.covariance)


def scaled_lens_misfit(problem: Problem, seen: Observations) -> LensMisfit | None:
    """The misfit in the views `seen` of intrinsics of pictures of another size, which lie elsewhere than a principal
    point does; None when scaled intrinsics do not fit better, or free ones fit much better still.

    Of the scales that fit, the simplest ratio: pictures are halved more often than made 0.493 times as large.
    """
    given, (width, height) = problem.camera, problem.image_size
    if given is None or len(seen) < MIN_VIEWS:
        return None
    places = (given.matrix[:2, 2] + 0.5) / (width, height)
    if np.any(places <= 0) or np.abs(places - 0.5).max() < MAX_CENTRE_OFF:
        return None
    centred = float(np.mean(0.5 / places))
    if np.abs(centred * places - 0.5).max() > MAX_CENTRE_OFF:
        return None
    few = seen.take(np.unique(np.linspace(0, len(seen) - 1, MAX_VIEWS).astype(np.intp)))

    def deviation_px(camera: CameraModel) -> float:
        return pixel_deviation(pixel_statistics(few, camera, candidate_poses(few, camera)[0][:, 0]))

    free = free_camera(problem)
    factors = SIMPLE_RATIOS if free is None else (*SIMPLE_RATIOS, float(free.camera.matrix[0, 0] / given.matrix[0, 0]))
    tried = {
        factor: deviation_px(scale_intrinsics(given, factor, problem.image_size))
        for factor in factors
        if max(factor / centred, centred / factor) < MAX_OFF_CENTRED
    }
    if not tried:
        return None
    fitting = MAX_RATIO_TO_SHAPE * min(tried.values())
    factor, after = next((factor, left) for factor, left in tried.items() if left <= fitting)
    before = min(deviation_px(given), float(np.hypot(width, height)))  # such intrinsics may leave any number
    if after >= before or (free and after > MAX_RATIO_TO_FREE * max(deviation_px(free.camera), MIN_FREE_PX)):
        return None
    camera = scale_intrinsics(given, factor, problem.image_size)
    return LensMisfit(camera, candidate_poses(seen, camera)[0][:, 0], before, after, abs(1 / factor - 1), True)


def free_camera(problem: Problem) -> CameraEstimate | None:
    """Intrinsics of the views alone; None when these do not determine them."""
    detections = [view.detection for view in problem.views if view.detection is not None]
    few = [detections[row] for row in np.unique(np.linspace(0, len(detections) - 1, MAX_VIEWS).astype(np.intp))]
    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            return estimate_camera(problem.target, few, problem.image_size)
    except (UndeterminedError, np.linalg.LinAlgError, ArithmeticError):
        return None


def scale_intrinsics(camera: CameraModel, factor: float, image_size: tuple[int, int]) -> CameraModel:
    """The intrinsics of the same camera's pictures when these are `factor` times as large."""
    matrix = camera.matrix.copy()
    matrix[:2] *= factor
    matrix[:2, 2] += 0.5 * (factor - 1)
    return replace(camera, matrix=matrix, image_size=image_size)


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
    return f_tail(INTRINSICS, left, ratio)
