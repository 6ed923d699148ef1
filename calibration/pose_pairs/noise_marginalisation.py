"""Marginalisation of X over the noise levels and the kind of camera, for few views.

Five pairs of poses leave eighteen numbers for six levels. The most likely levels are then often far off, mostly too
small, and the uncertainty of X would be underestimated by half. So X and its covariance are averaged over levels and
cameras, weighted by the restricted likelihood times a wide prior. Source: D. Harville, "Bayesian inference for variance
components using only error contrasts", Biometrika 61, 1974. The nodes are drawn from a proposal that is adapted to
earlier nodes: O. Cappé, A. Guillin, J. Marin & C. Robert, "Population Monte Carlo", J. Comput. Graph. Stat. 13(4),
2004.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp, ndtri

from calibration.linear_algebra import scaled_inverse_and_log_determinant
from calibration.observations.pose_model import clip_step
from calibration.pose_pairs.independent_noise import PoseFit
from calibration.pose_pairs.noise_models import RANDOM_WALK, Sources, cameras_of, sources_of
from calibration.pose_pairs.noise_priors import WIDE_PRIOR_FACTOR, prior_of
from calibration.pose_pairs.residuals import LinearisedPairs, PosePairs, linearise
from calibration.transforms import Array

MAX_VIEWS = 15
"""Most views for which the levels are averaged; more views determine them well enough."""

MAX_PRIOR_SIGMA = 3.0
"""Bound of the levels, in standard deviations of the prior."""

ROUNDS = (128, 128, 256, 512)
"""Nodes of each round; those of the last round are averaged."""

INITIAL_SIGMA, PROPOSAL_FACTOR = 0.8, 1.3
"""Standard deviation of the first proposal, of the logarithm of a level; of later ones, over that of the nodes."""

TEMPERS = np.geomspace(1.0, 0.02, 16)
MIN_EFFECTIVE_NODES = 6
"""Least effective number of nodes per level for a proposal; likelihoods are tempered by TEMPERS until it is reached."""

GENERATORS = np.sqrt([2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0])
"""Square roots of primes, for quasi-random points in up to seven dimensions (R. Richtmyer, 1951)."""


@dataclass(frozen=True, eq=False)
class _Nodes:
    """Log weights (k,) of k nodes, logarithms of their `levels` (k, g), steps (k, p) and covariances (k, p, p)."""

    log_weights: Array
    levels: Array
    steps: Array
    covariances: Array


def marginalise_few(pairs: PosePairs, fitted: PoseFit) -> PoseFit:
    """The fit with X averaged where up to MAX_VIEWS views leave the levels open; else the fit as it is."""
    normal = fitted.camera != RANDOM_WALK and not np.isfinite(fitted.tail_dof)
    return marginalise(pairs, fitted) if normal and len(pairs) <= MAX_VIEWS else fitted


def marginalise(pairs: PosePairs, fitted: PoseFit) -> PoseFit:
    """The fit with X averaged; `camera` and `variances` become those of the most likely kind of camera."""
    at = linearise(pairs, fitted.chain)
    cameras = {camera: sources_of(at, camera) for camera in cameras_of(pairs)}
    found = {camera: _nodes(at, sources, _start(fitted, sources)) for camera, sources in cameras.items()}
    log_weights = np.concatenate([nodes.log_weights for nodes in found.values()])
    weights = np.exp(log_weights - logsumexp(log_weights))
    steps = np.concatenate([nodes.steps for nodes in found.values()])
    step = weights @ steps
    off = steps - step
    covariance = np.tensordot(weights, np.concatenate([nodes.covariances for nodes in found.values()]), 1)
    likeliest = max(found, key=lambda camera: float(logsumexp(found[camera].log_weights)))
    nodes = found[likeliest]
    deviations = np.exp(nodes.log_weights - logsumexp(nodes.log_weights)) @ np.exp(nodes.levels)
    return replace(
        fitted,
        chain=fitted.chain.apply_step(clip_step(step)),
        covariance=covariance + (weights[:, None] * off).T @ off,
        variances=dict(zip(cameras[likeliest], (deviations**2).tolist(), strict=True)),
        camera=likeliest,
    )


def _nodes(at: LinearisedPairs, sources: Sources, start: Array) -> _Nodes:
    """The nodes of the last round for one kind of camera; the proposal is adapted to the posterior in each round."""
    prior = prior_of(list(sources))
    lowest, highest = (prior.mean + sign * MAX_PRIOR_SIGMA * prior.deviations for sign in (-1, 1))
    spreads = np.array([one @ np.swapaxes(one, 1, 2) for one in sources.values()])  # (g, n, 6, 6), of one unit each
    centre, root = start, INITIAL_SIGMA * np.eye(len(sources))
    for count in ROUNDS:
        drawn = _normal_points(count, len(sources))
        levels = np.clip(centre + drawn @ root.T, lowest, highest)
        log_likelihood, steps, covariances = _evaluate_levels(at, spreads, levels)
        density = -0.5 * np.sum(drawn**2, axis=1) - float(np.linalg.slogdet(root)[1])
        log_weights = log_likelihood + prior.log_density(levels) - density - np.log(count)
        centre, root = _fit_proposal(log_weights, levels)
    return _Nodes(log_weights, levels, steps, covariances)


def _fit_proposal(log_weights: Array, levels: Array) -> tuple[Array, Array]:
    """Centre (g,) and Cholesky factor (g, g) of the next proposal."""
    needed = MIN_EFFECTIVE_NODES * levels.shape[1]
    for temper in TEMPERS:
        weights = np.exp(temper * (log_weights - logsumexp(log_weights)))
        weights /= weights.sum()
        if 1 / np.sum(weights**2) > needed:
            break
    centre = weights @ levels
    off = levels - centre
    spread = (weights[:, None] * off).T @ off + 1e-4 * np.eye(len(centre))
    return centre, PROPOSAL_FACTOR * np.linalg.cholesky(spread)


def _evaluate_levels(at: LinearisedPairs, spreads: Array, levels: Array) -> tuple[Array, Array, Array]:
    """Restricted log-likelihood (k,), steps (k, p) and covariances (k, p, p) at logarithms of levels (k, g)."""
    k, p = len(levels), at.by_shared.shape[2]
    noise = np.tensordot(np.exp(2 * levels), spreads, 1) + at.floor  # (k, n, 6, 6)
    both = np.concatenate([at.by_shared, at.residuals[..., None]], axis=2)
    weighted = (np.linalg.inv(noise) @ both).reshape(k, -1, p + 1)
    total = both.reshape(-1, p + 1).T @ weighted
    normal, gradient, square = total[:, :p, :p], total[:, :p, p], total[:, p, p]
    covariances, log_normal = scaled_inverse_and_log_determinant(normal)
    steps = -(covariances @ gradient[..., None])[..., 0]
    square = square + np.sum(steps * gradient, axis=1)
    log_likelihood: Array = -0.5 * (np.linalg.slogdet(noise)[1].sum(axis=1) + log_normal + square)
    return log_likelihood, steps, covariances


def _start(fitted: PoseFit, sources: Sources) -> Array:
    """Logarithms (g,) of the fitted levels, at least one standard deviation below the prior's mean."""
    prior = prior_of(list(sources))
    known = np.array([fitted.variances.get(name, 0.0) for name in sources])
    start: Array = np.maximum(0.5 * np.log(np.maximum(known, 1e-300)), prior.mean - np.log(WIDE_PRIOR_FACTOR))
    return start


def _normal_points(count: int, dimensions: int) -> Array:
    """Quasi-random normal deviates (count, dimensions), deterministic."""
    spread = (np.outer(np.arange(1.0, count + 1), GENERATORS[:dimensions]) + 0.5) % 1.0
    return np.asarray(ndtri(spread), np.float64)
