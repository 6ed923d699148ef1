"""Marginalisation of X over the robot's noise levels.

With few views an estimate of a level may be a tenth of the truth, and for an exact robot it is above zero half of the
time. So X and its covariance are averaged over the levels, weighted by the restricted likelihood times a prior: noise
log-normal about PRIOR_NOISE, or none at all in the rotation, in the translation or in both. The influence of the prior
falls with the number of views.
Source: D. Harville, "Bayesian inference for variance components using only error contrasts", Biometrika 61, 1974.
"""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from calibration.kinematics.robot_accuracy import PRIOR_FACTOR, PRIOR_NOISE
from calibration.likelihood.mixed_model import MixedModel, Variances, sum_products
from calibration.likelihood.variance_components import redundancy
from calibration.linear_algebra import MIN_EIGENVALUE, scaled_inverse_and_log_determinant
from calibration.transforms import Array

MAX_PRIOR_VIEWS = 7
"""Most views for which the noise levels themselves are averaged; more views estimate them better than the prior."""

EXACT_PROBABILITY = 0.1
"""Prior probability that rotations are exact, that translations are, and that both are; for simulated cells."""

NODES = ((7, 9, 3.0), (20, 5, 2.2), (40, 3, 1.3))
"""(views up to, nodes for each level, reach in standard deviations); one node for more views."""

ITERATIONS, STEP_TOLERANCE = 8, 0.05
MAX_LOG_LIKELIHOOD_DEFICIT = 30.0
"""Branches whose log-likelihood is this far below the best are skipped."""


@dataclass(frozen=True, eq=False)
class Marginal:
    """Mean of the shared step (p,), its covariance (p, p), and the squares of the mean standard deviations.

    `log_evidence` of the model, up to a constant common to all models.
    """

    b: Array
    covariance: Array
    variances: Variances
    log_evidence: float


@dataclass(frozen=True, eq=False)
class _AtLevels:
    """Log of the restricted likelihood (k,), steps (k, p) and covariances (k, p, p) at k pairs of levels."""

    log_likelihood: Array
    b: Array
    covariance: Array


def marginalise(model: MixedModel, variances: Variances) -> Marginal:
    """The marginal over the robot's two levels, about the given estimates; the pixels' level is well determined.

    Raises FloatingPointError when no levels have a finite likelihood.
    """
    estimates = np.maximum(np.sqrt([variances.rotation, variances.translation]), 1e-2 * PRIOR_NOISE.levels())
    branches = [np.array(present) for present in product((True, False), repeat=2)]
    first = _at_levels(model, variances, np.array([np.where(present, estimates, 0.0) for present in branches]))
    likely = np.where(np.isfinite(first.log_likelihood), first.log_likelihood, -np.inf)
    if likely.max() == -np.inf:
        raise FloatingPointError("no levels of the robot's noise have a finite likelihood")
    kept = likely >= likely.max() - MAX_LOG_LIKELIHOOD_DEFICIT  # 30 less is the same number beside 1e18
    nodes = [_nodes(model, variances, estimates, present) for present in np.array(branches)[kept]]
    deviations, log_weights = (np.concatenate(parts) for parts in zip(*nodes, strict=True))
    found = _at_levels(model, variances, deviations)
    logs = log_weights + found.log_likelihood
    weights = np.exp(logs - logs.max())
    log_evidence = float(logs.max() + np.log(weights.sum())) + _constant(model, variances)
    weights /= weights.sum()
    mean = weights @ found.b
    off = found.b - mean
    covariance = np.tensordot(weights, found.covariance, 1) + (weights[:, None] * off).T @ off
    rotation, translation = (weights @ deviations) ** 2
    levels = replace(variances, rotation=float(rotation), translation=float(translation))
    return Marginal(mean, covariance, levels, log_evidence)


def _nodes(model: MixedModel, variances: Variances, estimates: Array, present: Array) -> tuple[Array, Array]:
    """Standard deviations (k, 2) about the most likely ones, and the logarithms (k,) of their prior weights."""
    count, reach = next(((count, reach) for views, count, reach in NODES if len(model.count) <= views), (1, 0.0))
    if not np.any(present):
        return np.zeros((1, 2)), np.array([np.log(EXACT_PROBABILITY)])
    logs, widths = _likeliest(model, variances, np.log(estimates), present)
    steps = np.linspace(-reach, reach, count)
    share = steps[1] - steps[0] if count > 1 else np.sqrt(2 * np.pi)
    grid = np.array(list(product(*(steps if here else [0.0] for here in present))))
    at = logs + widths * grid
    prior = -0.5 * (_prior_deviations(at) ** 2) - np.log(np.log(PRIOR_FACTOR) * np.sqrt(2 * np.pi))
    weight = ((prior + np.log(share * widths)) * present).sum(axis=1)
    return np.where(present, np.exp(at), 0.0), weight + np.log(
        1 - 3 * EXACT_PROBABILITY if np.all(present) else EXACT_PROBABILITY
    )


def _prior_deviations(logs: Array) -> Array:
    """Distances from the prior's median, in its standard deviations, of logarithms of the levels."""
    off: Array = (logs - np.log(PRIOR_NOISE.levels())) / np.log(PRIOR_FACTOR)
    return off


def _likeliest(model: MixedModel, variances: Variances, logs: Array, present: Array) -> tuple[Array, Array]:
    """Logarithms (2,) of the most likely levels and their standard deviations (2,), by Fisher scoring."""
    prior = 1 / np.log(PRIOR_FACTOR) ** 2
    for _ in range(ITERATIONS):
        levels = np.where(present, np.exp(2 * logs), 0.0)
        found = redundancy(model, replace(variances, rotation=float(levels[0]), translation=float(levels[1])))
        gradient = levels * (found.quadratic - found.trace) - prior * (logs - np.log(PRIOR_NOISE.levels()))
        information = 2 * levels[:, None] * found.fisher * levels + prior * np.eye(2)
        step = np.where(present, np.linalg.solve(information, gradient * present), 0.0)
        logs = logs + np.clip(step, -1.0, 1.0)
        if np.all(np.abs(step) < STEP_TOLERANCE):
            break
    return logs, 1 / np.sqrt(np.diagonal(information))


def _at_levels(model: MixedModel, variances: Variances, deviations: Array) -> _AtLevels:
    """Log-likelihoods, steps and covariances at standard deviations (k, 2) of the robot."""
    pixel, spread = variances.pixel, np.repeat(deviations, 3, axis=1)[:, None, :, None]  # (k, 1, 6, 1)
    spread_t = np.swapaxes(spread, 2, 3)
    scaled = spread * model.UU * spread_t / pixel + np.eye(6)
    K = spread * np.linalg.inv(scaled) * spread_t / pixel  # (k, n, 6, 6)
    p, columns, total = model.unknowns, model.UAy, model.total
    explained = sum_products(columns, K @ columns)
    beside = model.beside_views(variances)
    information = (total[:p, :p] - explained[:, :p, :p]) / pixel + beside[:p, :p]
    gradient = (total[:p, p] - explained[:, :p, p]) / pixel + beside[:p, p]
    covariance, log_S = scaled_inverse_and_log_determinant(information, MIN_EIGENVALUE)
    b = -(covariance @ gradient[..., None])[..., 0]
    log_V = np.linalg.slogdet(scaled)[1].sum(axis=1)
    quadratic = (total[p, p] - explained[:, p, p]) / pixel + beside[p, p] + np.sum(b * gradient, axis=1)
    return _AtLevels(-0.5 * (log_V + log_S + quadratic), b, covariance)


def restricted_log_likelihood(model: MixedModel, variances: Variances) -> float:
    """Logarithm of the restricted likelihood at the given levels, up to a constant common to all models."""
    robot = np.sqrt([[variances.rotation, variances.translation]])
    return float(_at_levels(model, variances, robot).log_likelihood[0]) + _constant(model, variances)


def _constant(model: MixedModel, variances: Variances) -> float:
    """The part of the restricted log-likelihood that does not depend on the robot's two levels."""
    known = model.full_prior_information(variances)
    return 0.5 * float(np.log(known[known > 0]).sum()) - 0.5 * float(model.count.sum() * np.log(variances.pixel))
