"""Where views are few, what is unknown about the noise is averaged over: its levels and the kind of camera.

Five pairs of poses leave eighteen numbers for six levels. The likeliest levels are then often far off, and mostly too
small, as if X were known twice as well as it is. So X and its covariance are averaged over the levels and cameras,
each as likely as the poses make it (restricted likelihood) times what robots and cameras are like, which is stated so
loosely that it only rules out the absurd. Source: D. Harville, "Bayesian inference for variance components using only
error contrasts", Biometrika 61, 1974. Nodes are drawn about where earlier ones were likely: O. Cappé, A. Guillin,
J. Marin & C. Robert, "Population Monte Carlo", J. Comput. Graph. Stat. 13(4), 2004.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp, ndtri

from calibration.linear_algebra import scaled_inverse_and_log_determinant
from calibration.observations.pose_model import clip_step
from calibration.pose_pairs.independent_noise import PoseFit
from calibration.pose_pairs.noise_models import CAMERAS, Sources, robot
from calibration.pose_pairs.noise_priors import WIDELY, prior_of
from calibration.pose_pairs.reml_optimizer import floor_variances
from calibration.pose_pairs.residuals import Linearised, PosePairs, linearise
from calibration.transforms import Array

MOST_VIEWS = 15
"""More views know the levels well enough to be taken at their likeliest."""

FURTHEST = 3.0
"""Deviations from what is known beforehand beyond which no level is looked for."""

ROUNDS = (128, 128, 256, 512)
"""Nodes of each round; the last one's are averaged."""

FIRST_SPREAD, WIDER = 0.8, 1.3
"""Of the first nodes, as natural logarithms of a level; of later ones, in deviations of those before."""

TEMPERS = np.geomspace(1.0, 0.02, 16)
ENOUGH = 6
"""Nodes that must count, per level, for their spread to be believed; likelihoods are flattened until they do."""

GENERATORS = np.sqrt([2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0])
"""Of evenly spread points in up to seven dimensions, as square roots of primes are (R. Richtmyer, 1951)."""


@dataclass(frozen=True, eq=False)
class _Nodes:
    """Log of what each of k nodes counts (k,), its `levels` (k, g), steps (k, p) and covariances (k, p, p)."""

    log_weights: Array
    levels: Array
    steps: Array
    covariances: Array


def averaged(pairs: PosePairs, fitted: PoseFit) -> PoseFit:
    """X about the likeliest fit's; `camera` and `variances` become those of the likeliest kind of camera."""
    at = linearise(pairs, fitted.chain)
    cameras = {camera: robot(at) | model(at) for camera, model in CAMERAS.items()}
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
        chain=fitted.chain.moved(clip_step(step)),
        covariance=covariance + (weights[:, None] * off).T @ off,
        variances=dict(zip(cameras[likeliest], (deviations**2).tolist(), strict=True)),
        camera=likeliest,
    )


def _nodes(at: Linearised, sources: Sources, start: Array) -> _Nodes:
    """The last round's, drawn about where the posterior of one camera's levels is."""
    prior = prior_of(list(sources))
    lowest, highest = (prior.mean + sign * FURTHEST * prior.deviations for sign in (-1, 1))
    spreads = np.array([one @ np.swapaxes(one, 1, 2) for one in sources.values()])  # (g, n, 6, 6), of one unit each
    centre, root = start, FIRST_SPREAD * np.eye(len(sources))
    for count in ROUNDS:
        drawn = _normal_points(count, len(sources))
        levels = np.clip(centre + drawn @ root.T, lowest, highest)
        log_likelihood, steps, covariances = _restricted(at, spreads, levels)
        density = -0.5 * np.sum(drawn**2, axis=1) - float(np.linalg.slogdet(root)[1])
        log_weights = log_likelihood + prior.log_density(levels) - density - np.log(count)
        centre, root = _gathered(log_weights, levels)
    return _Nodes(log_weights, levels, steps, covariances)


def _gathered(log_weights: Array, levels: Array) -> tuple[Array, Array]:
    """Where (g,) and how wide (g, g) to look next."""
    needed = ENOUGH * levels.shape[1]
    for temper in TEMPERS:
        weights = np.exp(temper * (log_weights - logsumexp(log_weights)))
        weights /= weights.sum()
        if 1 / np.sum(weights**2) > needed:
            break
    centre = weights @ levels
    off = levels - centre
    spread = (weights[:, None] * off).T @ off + 1e-4 * np.eye(len(centre))
    return centre, WIDER * np.linalg.cholesky(spread)


def _restricted(at: Linearised, spreads: Array, levels: Array) -> tuple[Array, Array, Array]:
    """Log of the restricted likelihood (k,), steps (k, p) and covariances (k, p, p) at levels (k, g)."""
    k, p = len(levels), at.by_shared.shape[2]
    noise = np.tensordot(np.exp(2 * levels), spreads, 1) + np.diag(floor_variances(at.scale))  # (k, n, 6, 6)
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
    """Logarithms (g,) of the fitted levels, where they are not below what is likely at all."""
    prior = prior_of(list(sources))
    known = np.array([fitted.variances.get(name, 0.0) for name in sources])
    start: Array = np.maximum(0.5 * np.log(np.maximum(known, 1e-300)), prior.mean - np.log(WIDELY))
    return start


def _normal_points(count: int, dimensions: int) -> Array:
    """Normal deviates (count, dimensions), evenly spread and the same every time."""
    spread = (np.outer(np.arange(1.0, count + 1), GENERATORS[:dimensions]) + 0.5) % 1.0
    return np.asarray(ndtri(spread), np.float64)
