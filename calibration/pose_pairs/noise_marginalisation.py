"""Marginalisation of X over the noise levels and the kind of camera, for few views.

Five pairs of poses leave eighteen numbers for six levels. The most likely levels are then often far off, mostly too
small, and the uncertainty of X would be underestimated by half. So X and its covariance are averaged over levels and
cameras, weighted by the restricted likelihood times a wide prior. Source: D. Harville, "Bayesian inference for variance
components using only error contrasts", Biometrika 61, 1974. The nodes are drawn from a proposal that is adapted to
earlier nodes: O. Cappé, A. Guillin, J. Marin & C. Robert, "Population Monte Carlo", J. Comput. Graph. Stat. 13(4),
2004.
"""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from scipy.special import logsumexp, ndtri

from calibration.linear_algebra import mixture_moments, scaled_inverse_and_log_determinant
from calibration.observations.pose_model import clip_step
from calibration.pose_pairs.independent_noise import PoseFit
from calibration.pose_pairs.noise_models import RANDOM_WALK, Sources, cameras_of, sources_of
from calibration.pose_pairs.noise_priors import WIDE_PRIOR_FACTOR, NoisePrior, prior_of
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

GENERATORS = np.sqrt([2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0, 19.0, 23.0, 29.0, 31.0])
"""Square roots of primes, for quasi-random points in up to eleven dimensions (R. Richtmyer, 1951)."""


class LinearModel(Protocol):
    """Residuals (n, m), their derivatives (n, m, p) by the unknowns, and the covariance (n, m, m) of known errors."""

    @property
    def residuals(self) -> Array: ...
    @property
    def by_shared(self) -> Array: ...
    @property
    def floor(self) -> Array: ...


@dataclass(frozen=True, eq=False)
class LevelNodes:
    """Log weights (k,) of k nodes, logarithms of their `levels` (k, g), steps (k, p) and covariances (k, p, p)."""

    log_weights: Array
    levels: Array
    steps: Array
    covariances: Array

    def weights(self) -> Array:
        """(k,), of sum 1."""
        return np.asarray(np.exp(self.log_weights - logsumexp(self.log_weights)), np.float64)

    def mean_step(self) -> tuple[Array, Array]:
        """The step (p,) and its covariance (p, p), averaged over the nodes."""
        return mixture_moments(self.weights(), self.steps, self.covariances)

    def mean_levels(self) -> Array:
        """The mean level (g,) of each source."""
        levels: Array = self.weights() @ np.exp(self.levels)
        return levels


def marginalise_few(pairs: PosePairs, fitted: PoseFit) -> PoseFit:
    """The fit with X averaged where up to MAX_VIEWS views leave the levels open; else the fit as it is."""
    normal = fitted.camera != RANDOM_WALK and not np.isfinite(fitted.tail_dof)
    return marginalise(pairs, fitted) if normal and len(pairs) <= MAX_VIEWS else fitted


def marginalise(pairs: PosePairs, fitted: PoseFit) -> PoseFit:
    """The fit with X averaged; `camera` and `variances` become those of the most likely kind of camera."""
    at = linearise(pairs, fitted.chain)
    cameras = {camera: sources_of(at, camera) for camera in cameras_of(pairs)}
    found = {camera: _nodes(at, sources, fitted) for camera, sources in cameras.items()}
    log_weights, steps, covariances = (
        np.concatenate([getattr(one, name) for one in found.values()])
        for name in ("log_weights", "steps", "covariances")
    )
    step, covariance = LevelNodes(log_weights, np.zeros((len(steps), 0)), steps, covariances).mean_step()
    likeliest = max(found, key=lambda camera: float(logsumexp(found[camera].log_weights)))
    return replace(
        fitted,
        chain=fitted.chain.apply_step(clip_step(step)),
        covariance=covariance,
        variances=dict(zip(cameras[likeliest], (found[likeliest].mean_levels() ** 2).tolist(), strict=True)),
        camera=likeliest,
    )


def draw_levels(
    at: LinearModel, directions: list[Array], prior: NoisePrior, start: Array, known: Array | None = None
) -> LevelNodes:
    """The nodes of the last round; the proposal is adapted to the posterior in each round.

    `directions`, `start`: of each source of noise (n, m, k), and the logarithms (g,) of their levels at first. `known`
    (p, p + 1): what is known of the unknowns besides the residuals, as information and gradient.
    """
    lowest, highest = (prior.mean + sign * MAX_PRIOR_SIGMA * prior.deviations for sign in (-1, 1))
    spreads = np.array([one @ np.swapaxes(one, 1, 2) for one in directions])  # (g, n, m, m), of one unit each
    centre, root = start, INITIAL_SIGMA * np.eye(len(directions))
    for count in ROUNDS:
        spread = (np.outer(np.arange(1.0, count + 1), GENERATORS[: len(directions)]) + 0.5) % 1.0
        drawn = np.asarray(ndtri(spread), np.float64)  # quasi-random normal deviates
        levels = np.clip(centre + drawn @ root.T, lowest, highest)
        log_likelihood, steps, covariances = _evaluate_levels(at, spreads, levels, known)
        density = -0.5 * np.sum(drawn**2, axis=1) - float(np.linalg.slogdet(root)[1])
        log_weights = log_likelihood + prior.log_density(levels) - density - np.log(count)
        centre, root = _fit_proposal(log_weights, levels)
    return LevelNodes(log_weights, levels, steps, covariances)


def step_at(at: LinearModel, directions: list[Array], levels: Array, known: Array | None = None) -> Array:
    """The Gauss-Newton step (p,) at logarithms of levels (g,); the rest as in `draw_levels`."""
    spreads = np.array([one @ np.swapaxes(one, 1, 2) for one in directions])
    step: Array = _evaluate_levels(at, spreads, levels[None], known)[1][0]
    return step


def _nodes(at: LinearisedPairs, sources: Sources, fitted: PoseFit) -> LevelNodes:
    prior = prior_of(list(sources))
    return draw_levels(at, list(sources.values()), prior, _start(fitted, sources, prior), at.known)


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


def _evaluate_levels(at: LinearModel, spreads: Array, levels: Array, known: Array | None) -> tuple[Array, Array, Array]:
    """Restricted log-likelihood (k,), steps (k, p) and covariances (k, p, p) at logarithms of levels (k, g)."""
    k, p = len(levels), at.by_shared.shape[2]
    noise = np.tensordot(np.exp(2 * levels), spreads, 1) + at.floor  # (k, n, m, m)
    both = np.concatenate([at.by_shared, at.residuals[..., None]], axis=2)
    weighted = (np.linalg.inv(noise) @ both).reshape(k, -1, p + 1)
    total = both.reshape(-1, p + 1).T @ weighted
    if known is not None:
        total[:, :p] += known
    normal, gradient, square = total[:, :p, :p], total[:, :p, p], total[:, p, p]
    covariances, log_normal = scaled_inverse_and_log_determinant(normal)
    steps = -(covariances @ gradient[..., None])[..., 0]
    square = square + np.sum(steps * gradient, axis=1)
    log_likelihood: Array = -0.5 * (np.linalg.slogdet(noise)[1].sum(axis=1) + log_normal + square)
    return log_likelihood, steps, covariances


def _start(fitted: PoseFit, sources: Sources, prior: NoisePrior) -> Array:
    """Logarithms (g,) of the fitted levels, at least one standard deviation below the prior's mean."""
    known = np.array([fitted.variances.get(name, 0.0) for name in sources])
    start: Array = np.maximum(0.5 * np.log(np.maximum(known, 1e-300)), prior.mean - np.log(WIDE_PRIOR_FACTOR))
    return start
