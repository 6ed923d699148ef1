"""p values of a change, or of another size of the target, beside robot errors that follow the pose.

The errors of an arm's geometry are alike at neighbouring poses. Views in the order of their places then differ between
the first and the last ones as if something had moved, which independent errors of the views do not explain. Here a
share of the robot's variance belongs to a Gaussian process over the pose, half of it along the flange's axes and half
along the base's (C. E. Rasmussen & C. K. I. Williams, Gaussian Processes for Machine Learning, 2006, 2.7). Share and
length are as unknown as the levels are, and the p value is averaged over all of them as in `significance`.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np
import scipy

from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.fit import MIN_VARIANCES, Fit, apply_fit
from calibration.diagnosis.significance import NoisePosterior
from calibration.kinematics.robot_accuracy import PRIOR_FACTOR, PRIOR_NOISE
from calibration.likelihood.distributions import chi_squared_tail
from calibration.linear_algebra import scaled_inverse_and_log_determinant, squared_distances
from calibration.transforms import Array

PRIOR_PROBABILITY = 0.5
"""Prior probability that a part of the robot's errors follows the pose: of most arms."""

SHARES = (0.5, 0.9, 0.99)
"""Shares of the robot's variance that follow the pose, alike probable."""

LENGTHS = (0.7, 1.4)
"""Lengths of the process in RMS distances of the poses from their middle, alike probable."""

MAX_SMALL_CHANCE = 1e-3
"""A fault with a larger p value is not named, whatever the number of alternatives."""

MAX_TRAVEL_SHARE = 5e-4
"""Largest standard deviation of an arm's travel, as a share of it: two of them are a millimetre a metre, and links are
off by no more."""

MIN_SPREAD = 1e-12
"""Of places or turns that are all the same."""

LEVELS = np.array([-1.0, 0.0, 1.0, 2.0])
"""Nodes for each level, in logarithms of a standard deviation over the fit's, which lacks what X takes up."""


def p_value_beside_all_errors(
    evidence: Evidence, fitted: Fit, value: Array, by_unknowns: Array, *, is_size: bool = False
) -> float:
    """p value of `value` (d,), the fit's `by_unknowns` (d, p) @ shared unknowns, when the truth is zero.

    `is_size`: the value is the logarithm of the target's size, which an arm with links of other lengths changes.

    The larger one of that beside independent errors of the robot and, where those say it is small, of that beside
    errors that follow the pose and those of an estimated camera.
    """
    chance = NoisePosterior.of(fitted, evidence.by_camera).p_value_of(value, by_unknowns)
    if chance > MAX_SMALL_CHANCE:
        return chance
    places = evidence.base_T_flange[:, :3, 3]
    spread = float(np.mean(np.sum((places - places.mean(axis=0)) ** 2, axis=1)))
    by_travel = 1 / max(spread, MIN_SPREAD) if is_size else 0.0
    return max(chance, p_value_beside_pose_errors(evidence, fitted, value, by_unknowns, by_travel))


def p_value_of_view(evidence: Evidence, fitted: Fit, row: int) -> float:
    """p value of one view, which is not part of the fit, when it has no error but those that follow the posture."""
    seen = apply_fit(evidence, fitted)
    n, _, p = seen.by_shared.shape
    own = np.eye(n)[:, row, None, None] * np.eye(6)
    extended = replace(seen, by_shared=np.concatenate([seen.by_shared, own], axis=2))
    return p_value_beside_pose_errors(evidence, extended, np.zeros(6), np.eye(6, p + 6, p), 0.0)


def p_value_beside_pose_errors(
    evidence: Evidence, fitted: Fit, value: Array, by_unknowns: Array, by_travel: float
) -> float:
    """p value of `value` (d,), the fit's `by_unknowns` (d, p) @ shared unknowns, when the truth is zero.

    `by_travel`: variance of the value by errors that follow the pose, over the robot's variance in mm², in 1/mm².
    0 where no covariance can be factored, of numbers that no cell has.
    """
    n, _, p = fitted.by_shared.shape
    by_images = scipy.linalg.block_diag(*fitted.image_covariance)
    if evidence.by_camera is not None:
        by_camera = evidence.by_camera.reshape(6 * n, -1)
        by_images += by_camera @ by_camera.T
    both = np.concatenate([fitted.by_shared, fitted.residuals[..., None]], axis=2).reshape(6 * n, p + 1)
    logs = 0.5 * np.log(np.maximum(fitted.variances, MIN_VARIANCES)) + np.array(list(product(LEVELS, LEVELS)))
    stated = -0.5 * np.sum(((logs - np.log(PRIOR_NOISE.levels())) / np.log(PRIOR_FACTOR)) ** 2, axis=1)
    likely, chances = [], []
    for follows, (prior, correlation) in enumerate(_correlations(evidence)):
        turned, shifted = (_by_robot(fitted.by_robot[:, :, part], correlation) for part in (slice(3), slice(3, 6)))
        for levels, known in zip(np.exp(2 * logs), stated, strict=True):
            covariance = by_images + levels[0] * turned + levels[1] * shifted
            try:
                root = np.linalg.cholesky(covariance)
            except np.linalg.LinAlgError:
                continue
            white = scipy.linalg.solve_triangular(root, both, lower=True, check_finite=False)
            normal, gradient = white[:, :p].T @ white[:, :p], white[:, :p].T @ white[:, p]
            shared, log_determinant = scaled_inverse_and_log_determinant(normal)
            step = -shared @ gradient
            square = white[:, p] @ white[:, p] + step @ gradient
            determinant = 2 * np.log(np.diagonal(root)).sum() + log_determinant
            likely.append(np.log(prior) + known - 0.5 * (determinant + square))
            alike = min(by_travel * levels[1], MAX_TRAVEL_SHARE**2) if follows else 0.0
            spread = by_unknowns @ shared @ by_unknowns.T + alike * np.eye(len(value))
            distance = squared_distances(value + by_unknowns @ step, spread)
            chances.append(float(chi_squared_tail(len(value), distance)))
    if not likely:
        return 0.0
    weights = np.exp(np.array(likely) - np.max(likely))
    return float(weights @ np.array(chances) / weights.sum())


def _correlations(evidence: Evidence) -> Iterator[tuple[float, Array]]:
    """Prior probability and correlation (n, 3, n, 3) of the errors along the flange's axes, without and with a part
    that follows the pose."""
    n, R = len(evidence), evidence.base_T_flange[:, :3, :3]
    own = np.eye(n)[:, None, :, None] * np.eye(3)[:, None, :]
    yield 1 - PRIOR_PROBABILITY, own
    along = 0.5 * (np.eye(3)[:, None, :] + np.einsum("ika,jkb->iajb", R, R))
    apart = _squared_distances(evidence)
    for share, length in product(SHARES, LENGTHS):
        alike = np.exp(-0.5 * apart / length**2)[:, None, :, None]
        yield PRIOR_PROBABILITY / (len(SHARES) * len(LENGTHS)), share * alike * along + (1 - share) * own


def _squared_distances(evidence: Evidence) -> Array:
    """Squared distances (n, n) of the postures, where the joints are known, or else of the poses.

    Of the joints' cosines and sines; of the places and of the rotation matrices. Together they have a mean square of 1
    from their middle.
    """
    q, poses = evidence.joints_rad, evidence.base_T_flange
    parts = (poses[:, :3, 3], poses[:, :3, :3].reshape(-1, 9)) if q is None else (np.hstack([np.cos(q), np.sin(q)]),)
    total = np.zeros((len(evidence), len(evidence)))
    for part in parts:
        off = part - part.mean(axis=0)
        spread = max(len(parts) * float(np.mean(np.sum(off**2, axis=1))), MIN_SPREAD)
        total += np.sum((off[:, None] - off) ** 2, axis=-1) / spread
    return total


def _by_robot(by_robot: Array, correlation: Array) -> Array:
    """Covariance (6 n, 6 n) of the residuals by errors with this correlation (n, 3, n, 3); `by_robot` (n, 6, 3)."""
    n = len(by_robot)
    left = np.einsum("iua,iajb->iujb", by_robot, correlation)
    covariance: Array = np.einsum("iujb,jvb->iujv", left, by_robot).reshape(6 * n, 6 * n)
    return covariance
