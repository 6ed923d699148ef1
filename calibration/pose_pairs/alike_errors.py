"""Errors that like views share: of a detector, by where and how the target stands, or of a robot, by its posture.

The noise levels of a session are estimated as if the errors of its views were independent. Where a share of them is a
smooth function of the target's pose in the camera, many like views know less than they seem to. So X and its covariance
are averaged over that share and the function's length, weighted by the restricted likelihood times a prior. A session
whose residuals show nothing alike keeps nearly its covariance.
Source: C. Rasmussen & C. Williams, Gaussian Processes for Machine Learning, MIT Press 2006, sections 2.2 and 5.4.
"""

from dataclasses import replace

import numpy as np
from scipy.linalg import cho_solve, cholesky

from calibration.linear_algebra import covariance_of, mixture_moments
from calibration.observations.pose_model import clip_step
from calibration.pose_pairs.independent_noise import PoseFit
from calibration.pose_pairs.noise_models import RANDOM_WALK, sources_of
from calibration.pose_pairs.residuals import LinearisedPairs, PosePairs, linearise
from calibration.transforms import Array

MIN_VIEWS = 8
"""Least views in which like errors differ visibly from independent ones."""

MAX_VIEWS = 150
"""Most views that are weighed against one another; of more, so many evenly spaced ones."""

SHARES = (0.1, 0.25, 0.5, 0.75, 0.95)
"""Of the variance of a view's errors."""

LENGTHS = (0.15, 0.3, 0.6, 1.2)
"""Over which the errors stay alike: radians by which the target turns, and shares of half its distance it moves by."""

PRIOR_PROBABILITY = 0.2
"""Prior probability that any share is alike, spread evenly over SHARES and LENGTHS."""


def with_alike_errors(pairs: PosePairs, fitted: PoseFit) -> PoseFit:
    """The fit of these views with X averaged over errors that like views share, and the covariance of that mean.

    Unchanged for fewer than MIN_VIEWS views, and for errors that add up from view to view.
    """
    if len(pairs) < MIN_VIEWS or fitted.camera == RANDOM_WALK:
        return fitted
    chosen = np.zeros(len(pairs), bool)
    chosen[np.linspace(0, len(pairs) - 1, min(len(pairs), MAX_VIEWS)).astype(np.intp)] = True
    at = linearise(pairs.take(chosen), fitted.chain)
    n, p = at.by_shared.shape[0], at.by_shared.shape[2]
    sources = sources_of(at, fitted.camera)
    spread = np.concatenate([one * np.sqrt(fitted.variances[name]) for name, one in sources.items()], axis=2)
    between = np.einsum("nik,mjk->nimj", spread, spread)
    own = between[np.arange(n), :, np.arange(n)]
    squared = _squared_distances(at.predicted)
    found = [_solve(at, _block_diagonal(own + at.floor))]
    priors, cells = [1 - PRIOR_PROBABILITY], len(SHARES) * len(LENGTHS)
    for length in LENGTHS:
        alike = (between * np.exp(-squared / (2 * length**2))[:, None, :, None]).reshape(6 * n, 6 * n)
        for share in SHARES:
            found.append(_solve(at, share * alike + _block_diagonal((1 - share) * own + at.floor)))
            priors.append(PRIOR_PROBABILITY / cells)
    logs, steps, covariances = (np.array(part) for part in zip(*found, strict=True))
    weights = np.array(priors) * np.exp(logs - logs.max())
    weights /= weights.sum()
    step, averaged = mixture_moments(weights, steps, covariances)
    covariance = fitted.covariance.copy()
    covariance[:p, :p] += averaged - covariances[0]
    return replace(fitted, chain=fitted.chain.apply_step(clip_step(step - steps[0])), covariance=covariance)


def _squared_distances(camera_T_target: Array) -> Array:
    """(n, n) between poses: turns in radians, and moves over half the median distance."""
    places = camera_T_target[:, :3, 3]
    distance = float(np.median(np.linalg.norm(places, axis=1)))
    turns = camera_T_target[:, :3, :3].reshape(-1, 9) / np.sqrt(2)
    features = np.concatenate([2 * places / distance, turns], axis=1)
    return np.asarray(np.sum((features[:, None] - features) ** 2, axis=-1))


def _block_diagonal(blocks: Array) -> Array:
    n = len(blocks)
    whole = np.zeros((n, 6, n, 6))
    whole[np.arange(n), :, np.arange(n)] = blocks
    return whole.reshape(6 * n, 6 * n)


def _solve(at: LinearisedPairs, covariance: Array) -> tuple[float, Array, Array]:
    """The restricted log-likelihood with the level of all errors profiled out, the step (p,), its covariance."""
    m, p = len(covariance), at.by_shared.shape[2]
    columns, residuals = at.by_shared.reshape(m, p), at.residuals.reshape(m)
    lower = cholesky(covariance, lower=True)
    weighed = cho_solve((lower, True), np.column_stack([columns, residuals]))
    normal = columns.T @ weighed[:, :p]
    found = covariance_of(normal)
    step = -found @ (columns.T @ weighed[:, p])
    level = max(float(residuals @ (weighed[:, p] + weighed[:, :p] @ step)) / (m - p), 1e-300)  # of exact poses 0
    determinants = 2 * float(np.log(np.diagonal(lower)).sum()) + float(np.linalg.slogdet(normal)[1])
    return -0.5 * (determinants + (m - p) * float(np.log(level))), step, max(level, 1.0) * found
