"""Whether the lengths in the camera's poses are millimetres: another unit, or a factor near one."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calibration.likelihood.distributions import f_quantile
from calibration.observations.measured_poses import MeasuredViews, require_unit
from calibration.pose_pairs.independent_noise import PoseFit, fit_independent_noise
from calibration.pose_pairs.noise_marginalisation import marginalise_few
from calibration.pose_pairs.noise_models import RANDOM_WALK, cameras_of
from calibration.pose_pairs.random_walk_noise import with_random_walk
from calibration.pose_pairs.residuals import PosePairs, initial_chain
from calibration.pose_pairs.session_findings import contradicts
from calibration.solution import ArmScale

MIN_SCALE_VIEWS = 6
"""Least views from which a factor is taken to be off; fewer only shift X and widen U by its probability."""

SCALE_FALSE_ALARM_PROBABILITY = 1e-5
USUAL_SCALE_ERROR, SCALE_OFF_PROBABILITY = 2e-3, 0.1
"""Prior of an error of the camera's lengths: one standard deviation, and the probability that there is one."""

MIN_USUAL_SCALE_ERROR = 3e-4
"""The same of a camera whose points are as far apart as those of the described target."""

MIN_SCALE_ERROR = 2e-4
"""Errors of the camera's lengths below it are ignored."""

MAX_SCALE_ERROR = 0.5

MIN_UNIT_GAIN = 5.0
"""Factor by which the target's scatter must fall for a wrong unit of the poses to be named."""

MIN_CELL_MM = 10.0
"""No flange works this near to the robot's base; a smaller median distance is in metres."""

UNIT_RATIOS = (1e-3, 0.1, 1 / 25.4, 1 / 39.37, 25.4, 39.37, 1e3)
MAX_UNIT_ERROR = 0.15


def usual_error_of(seen: MeasuredViews) -> float:
    """One standard deviation of an error of the camera's lengths; measured points are compared with the target's."""
    if seen.points_mm is None:
        return USUAL_SCALE_ERROR
    return min(max(abs(seen.size_ratio - 1), MIN_USUAL_SCALE_ERROR), USUAL_SCALE_ERROR)


def require_units(pairs: PosePairs) -> None:
    """Raises UndeterminedError where the robot's lengths, or the camera's beside them, are in another unit."""
    if not len(pairs.base_T_flange):
        return
    if np.median(np.linalg.norm(pairs.base_T_flange[:, :3, 3], axis=1)) < MIN_CELL_MM:
        require_unit(1e-3, "poses", "the robot's translations are", "base_T_flange.translation_mm")
    free = initial_chain(replace(pairs, metric=False))
    unit = next((unit for unit in UNIT_RATIOS if abs(np.log(free.scale / unit)) < MAX_UNIT_ERROR), None)
    if unit is None:
        return
    corrected = pairs.camera_T_target.copy()
    corrected[:, :3, 3] /= unit
    if MIN_UNIT_GAIN * _scatter(replace(pairs, camera_T_target=corrected)) > _scatter(pairs):
        return
    if unit < 1:
        require_unit(unit, "camera-poses", "the camera's poses of the target are", "camera_T_target.translation_mm")
    require_unit(1 / unit, "poses", "the robot's translations are", "base_T_flange.translation_mm")


def _scatter(pairs: PosePairs) -> float:
    """Median distance of the target's origin in the anchor from its middle, with X in closed form."""
    X = initial_chain(pairs).mount_T_camera
    places = (pairs.anchor_T_mount() @ X @ pairs.camera_T_target)[:, :3, 3]
    return float(np.median(np.linalg.norm(places - np.median(places, axis=0), axis=1))) + 1e-9


def with_lengths(
    pairs: PosePairs, fitted: PoseFit, used: NDArray[np.bool_], usual_error: float
) -> tuple[PosePairs, PoseFit]:
    """The fit with the camera's lengths off by a factor where that is significant; else the mean with and without.

    `usual_error`: one standard deviation of such an error, relative.
    """
    views = int(used.sum())
    free = replace(pairs, metric=False)
    scaled = _with_free_lengths(free.take(used), fitted)
    share, deviation = float(np.log(scaled.chain.scale)), float(np.sqrt(scaled.covariance[12, 12]))
    limit = deviation * f_quantile(1, 3 * views - 7, SCALE_FALSE_ALARM_PROBABILITY) ** 0.5
    if views >= MIN_SCALE_VIEWS and abs(share) > max(limit, MIN_SCALE_ERROR):
        wrong = contradicts(scaled) or abs(share) > MAX_SCALE_ERROR
        lengths = ArmScale(-share, deviation**2, -scaled.covariance[:6, 12])
        return (pairs, fitted) if wrong else (free, replace(scaled, arm_scale=lengths))
    return pairs, _averaged(fitted, scaled, usual_error, 3 * views - 7)


def _with_free_lengths(free: PosePairs, fitted: PoseFit) -> PoseFit:
    """The fit to the same views with lengths of an unknown unit; lengths that are off may look like a random walk."""
    drifting = fitted.camera == RANDOM_WALK
    cameras = cameras_of(free) if drifting else (fitted.camera,)
    fits = [fit_independent_noise(free, fitted.chain, camera, fitted.tail_dof) for camera in cameras]
    likeliest = max(fits, key=lambda one: one.evidence(len(free)))
    return marginalise_few(free, with_random_walk(free, likeliest) if drifting else likeliest)


def _averaged(fitted: PoseFit, scaled: PoseFit, usual_error: float, freedom: int) -> PoseFit:
    """The mean of the fit and of one with lengths off by `usual_error` (1 sigma), weighted by their probabilities.

    The covariance is that of lengths that are off, so that it holds for such a camera too.
    """
    share, variance = float(np.log(scaled.chain.scale)), float(scaled.covariance[12, 12])
    probability = _probability_of(share, variance, usual_error**2, freedom)
    kept = usual_error**2 / (usual_error**2 + variance)  # what the prior leaves of the estimate
    slope = scaled.covariance[:12, 12] / variance
    shift = slope * share * kept
    covariance = fitted.covariance[:12, :12] + variance * kept * np.outer(slope, slope)
    covariance += (1 - probability) ** 2 * np.outer(shift, shift)
    moved = fitted.chain.apply_step(probability * shift)
    share *= kept
    chain = replace(moved, scale=float(np.exp(probability * share)))
    spread = variance * kept + ((1 - probability) * share) ** 2
    lengths = ArmScale(-probability * share, spread, -spread * slope[:6])
    return replace(fitted, chain=chain, covariance=covariance, arm_scale=lengths)


def _probability_of(share: float, variance: float, prior_variance: float, freedom: int) -> float:
    """Posterior probability that the camera's lengths are off, by `share` with its variance and degrees of freedom.

    The ratio of both models' evidence is that of the prior to the posterior density at no error (Dickey 1971).
    """
    total = variance + prior_variance
    surprise = share**2 * prior_variance / total / variance
    log_ratio = 0.5 * np.log(variance / total) + 0.5 * (freedom + 1) * np.log1p(surprise / freedom)
    odds = np.log(SCALE_OFF_PROBABILITY / (1 - SCALE_OFF_PROBABILITY)) + log_ratio
    return float(1 / (1 + np.exp(-np.clip(odds, -500.0, 500.0))))
