"""Whether the lengths in the camera's poses are millimetres: another unit, or a factor near one."""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from calibration.knowledge import ARM_SHARE, FOCAL_SHARE, Knowledge
from calibration.likelihood.distributions import f_quantile
from calibration.linear_algebra import mixture_moments
from calibration.observations.measured_poses import MeasuredViews, require_unit
from calibration.pose_pairs.independent_noise import PoseFit, fit_independent_noise
from calibration.pose_pairs.noise_marginalisation import marginalise_few
from calibration.pose_pairs.noise_models import RANDOM_WALK, cameras_of
from calibration.pose_pairs.random_walk_noise import with_random_walk
from calibration.pose_pairs.residuals import PosePairs, initial_chain
from calibration.pose_pairs.session_findings import contradicts
from calibration.solution import ArmScale
from calibration.transforms import Array

MIN_SCALE_VIEWS = 6
"""Least views from which a factor is named and taken as found; with fewer, X is averaged over what it may be."""

SCALE_FALSE_ALARM_PROBABILITY = 1e-5
USUAL_SCALE_ERROR, MIN_USUAL_SCALE_ERROR = 2e-3, 3e-4
"""Standard deviation of an error of the lengths of a camera that measures points, and where these are as far apart as
those of the described target."""

MIN_SCALE_ERROR = 2e-4
"""Errors of the camera's lengths below it are ignored."""

MAX_SCALE_ERROR = 0.5

REFOCUS_PROBABILITY = 0.25
"""That another focus than stated is not the same in all views: the least for which U (k = 2) contains both well."""

MIN_UNIT_GAIN = 5.0
"""Factor by which the target's scatter must fall for a wrong unit of the poses to be named."""

MIN_CELL_MM = 10.0
"""No flange works this near to the robot's base; a smaller median distance is in metres."""

UNIT_RATIOS = (1e-3, 0.1, 1 / 25.4, 1 / 39.37, 25.4, 39.37, 1e3)
MAX_UNIT_ERROR = 0.15


@dataclass(frozen=True, eq=False)
class LengthPrior:
    """A mixture of m normal densities about zero of [log scale, log depth] of the camera, or of the first alone.

    weights : (m,), of sum 1. sigmas : (m, q) standard deviations.
    """

    weights: Array
    sigmas: Array

    @classmethod
    def about(cls, seen: MeasuredViews, stated: Knowledge) -> "LengthPrior":
        """From what is stated of target, arm and camera; points measured in space are compared with the target's."""
        if seen.points_mm is not None:
            usual = min(max(abs(seen.size_ratio - 1), MIN_USUAL_SCALE_ERROR), USUAL_SCALE_ERROR)
            return cls(np.ones(1), np.array([[usual]]))
        parts = product(stated.target.size_prior(), ARM_SHARE[stated.arm], FOCAL_SHARE[stated.camera])
        rows = np.array([(a * b * c, np.hypot(size, arm), focal) for (a, size), (b, arm), (c, focal) in parts])
        return cls(rows[:, 0], rows[:, 1:])

    def widest(self) -> tuple[float, ...]:
        """The widest standard deviation (q,) of each."""
        return tuple(self.sigmas.max(axis=0).tolist())

    def after(self, found: Array, spread: Array, freedom: int) -> tuple[Array, Array]:
        """Mean and covariance after an estimate with its covariance under the widest densities, of so many freedoms.

        Depths that are off by more than the narrowest density tells may be those of a lens that refocuses: with
        REFOCUS_PROBABILITY. They are right in the mean, and X does not follow them.
        """
        q = len(found)
        information, prior = np.linalg.inv(spread), self.sigmas[:, :q] ** -2.0
        more = (prior - prior.min(axis=0))[:, :, None] * np.eye(q)
        covariances = np.linalg.inv(information + more)
        means = covariances @ information @ found
        surprise = (found - means) @ information @ found
        logs = np.log(self.weights) + 0.5 * (np.log(prior).sum(axis=1) + np.linalg.slogdet(covariances)[1])
        logs -= 0.5 * (freedom + q) * np.log1p(np.maximum(surprise, 0.0) / freedom)
        weights = np.exp(logs - logs.max())
        weights /= weights.sum()
        if q > 1:
            stay, another = np.array([1.0, 0.0]), self.sigmas[:, 1] > self.sigmas[:, 1].min()
            moving = REFOCUS_PROBABILITY * another * weights
            means, weights = np.concatenate([means, means * stay]), np.concatenate([weights - moving, moving])
            covariances = np.concatenate([covariances, covariances * np.outer(stay, stay)])
        return mixture_moments(weights, means, covariances)


def require_units(pairs: PosePairs) -> None:
    """Raises UndeterminedError where the robot's lengths, or the camera's beside them, are in another unit."""
    if not len(pairs.base_T_flange):
        return
    if np.median(np.linalg.norm(pairs.base_T_flange[:, :3, 3], axis=1)) < MIN_CELL_MM:
        require_unit(1e-3, "poses", "the robot's translations are", "base_T_flange.translation_mm")
    free = initial_chain(replace(pairs, length_sigmas=(np.inf,)))
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


def with_lengths(pairs: PosePairs, fitted: PoseFit, used: NDArray[np.bool_], prior: LengthPrior) -> PoseFit:
    """The fit with X and its covariance averaged over the factor of the camera's lengths and that of its depths.

    About the fit that has both as unknowns where one is significantly off.
    """
    views = int(used.sum())
    scaled = _with_free_lengths(replace(pairs, length_sigmas=prior.widest()).take(used), fitted)
    found = np.log([scaled.chain.scale, scaled.chain.depth])[: len(scaled.covariance) - 12]
    spread, freedom = scaled.covariance[12:, 12:], 3 * views - 6 - len(found)
    limit = np.sqrt(np.diagonal(spread) * f_quantile(1, freedom, SCALE_FALSE_ALARM_PROBABILITY))
    off = (np.abs(found) > np.maximum(limit, MIN_SCALE_ERROR)) & (views >= MIN_SCALE_VIEWS)
    if off.any() and (contradicts(scaled) or abs(found[0]) > MAX_SCALE_ERROR):
        return fitted
    slope = np.linalg.solve(spread, scaled.covariance[12:, :12]).T
    log_lengths, variance = prior.after(found, spread, freedom)
    start, about, covariance = fitted, np.zeros(len(found)), fitted.covariance[:12, :12]
    if off.any():
        start, about, covariance = scaled, found, scaled.covariance[:12, :12] - slope @ spread @ slope.T
    step = log_lengths - about
    return replace(
        start,
        chain=start.chain.apply_step(np.r_[slope @ step, step]),
        covariance=covariance + slope @ variance @ slope.T,
        arm_scale=ArmScale(-log_lengths[0], variance[0, 0], -(slope @ variance)[:6, 0]),
        off=tuple(off.tolist()),
    )


def _with_free_lengths(free: PosePairs, fitted: PoseFit) -> PoseFit:
    """The fit to the same views with lengths of an unknown unit; lengths that are off may look like a random walk."""
    drifting = fitted.camera == RANDOM_WALK
    cameras = cameras_of(free) if drifting else (fitted.camera,)
    fits = [fit_independent_noise(free, fitted.chain, camera, fitted.tail_dof) for camera in cameras]
    likeliest = max(fits, key=lambda one: one.evidence(len(free)))
    return marginalise_few(free, with_random_walk(free, likeliest) if drifting else likeliest)
