"""The robot's noise levels are averaged over, not only estimated.

A few views leave few observations of each level, and an estimate may well be a tenth of the truth; and where a robot
is exact an estimate is above zero half of the time. So X and its covariance are averaged over the levels, each as
likely as the residuals make it (restricted likelihood) times what robots are like: noise log-normal about a stated
level, or none at all in the rotation, in the translation or in both. The more views, the less the statement matters.
Source: D. Harville, "Bayesian inference for variance components using only error contrasts", Biometrika 61, 1974.
"""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from calibration.kinematics.robot_accuracy import PRIOR_FACTOR, PRIOR_NOISE
from calibration.likelihood.mixed_model import MixedModel, Variances, summed_products
from calibration.likelihood.variance_components import redundancy
from calibration.linear_algebra import MIN_EIGENVALUE, scaled_inverse_and_log_determinant
from calibration.transforms import Array

MOST_STATED_VIEWS = 7
"""More views know the levels better than anybody states them."""

EXACT = 0.1
"""How likely rotations are exact, translations are, and both: each once in ten cells, simulated ones among them."""

NODES = ((7, 9, 3.0), (20, 5, 2.2), (40, 3, 1.3))
"""Up to so many views, this many nodes of each level, out to so many deviations; one node beyond."""

ITERATIONS, SETTLED = 8, 0.05
HOPELESS = 30.0
"""Log-likelihood below the best at which a branch is not looked at any closer."""


@dataclass(frozen=True, eq=False)
class Averaged:
    """Mean of the shared step (p,), its covariance (p, p), and the mean of the levels' deviations, squared.

    `log_evidence`: of the model as a whole, up to what no model changes.
    """

    b: Array
    covariance: Array
    variances: Variances
    log_evidence: float


@dataclass(frozen=True, eq=False)
class _At:
    """Log of the restricted likelihood (k,), steps (k, p) and covariances (k, p, p) at k pairs of levels."""

    log_likelihood: Array
    b: Array
    covariance: Array


def averaged(model: MixedModel, variances: Variances) -> Averaged:
    """Over the robot's two levels, about the given estimate; the pixels are many, and their level is known."""
    estimates = np.maximum(np.sqrt([variances.rotation, variances.translation]), 1e-2 * PRIOR_NOISE.levels())
    branches = [np.array(present) for present in product((True, False), repeat=2)]
    first = _at(model, variances, np.array([np.where(present, estimates, 0.0) for present in branches]))
    worth = first.log_likelihood > first.log_likelihood.max() - HOPELESS
    nodes = [_nodes(model, variances, estimates, present) for present in np.array(branches)[worth]]
    deviations, log_weights = (np.concatenate(parts) for parts in zip(*nodes, strict=True))
    found = _at(model, variances, deviations)
    logs = log_weights + found.log_likelihood
    weights = np.exp(logs - logs.max())
    log_evidence = float(logs.max() + np.log(weights.sum())) + _constant(model, variances)
    weights /= weights.sum()
    mean = weights @ found.b
    off = found.b - mean
    covariance = np.tensordot(weights, found.covariance, 1) + (weights[:, None] * off).T @ off
    rotation, translation = (weights @ deviations) ** 2
    levels = replace(variances, rotation=float(rotation), translation=float(translation))
    return Averaged(mean, covariance, levels, log_evidence)


def _nodes(model: MixedModel, variances: Variances, estimates: Array, present: Array) -> tuple[Array, Array]:
    """Deviations (k, 2) about the likeliest, and the log of what each stands for (k,)."""
    count, reach = next(((count, reach) for views, count, reach in NODES if len(model.count) <= views), (1, 0.0))
    if not np.any(present):
        return np.zeros((1, 2)), np.array([np.log(EXACT)])
    logs, widths = _likeliest(model, variances, np.log(estimates), present)
    steps = np.linspace(-reach, reach, count)
    share = steps[1] - steps[0] if count > 1 else np.sqrt(2 * np.pi)
    grid = np.array(list(product(*(steps if here else [0.0] for here in present))))
    at = logs + widths * grid
    prior = -0.5 * (_from_stated(at) ** 2) - np.log(np.log(PRIOR_FACTOR) * np.sqrt(2 * np.pi))
    weight = ((prior + np.log(share * widths)) * present).sum(axis=1)
    return np.where(present, np.exp(at), 0.0), weight + np.log(1 - 3 * EXACT if np.all(present) else EXACT)


def _from_stated(logs: Array) -> Array:
    """In deviations of what robots are like."""
    off: Array = (logs - np.log(PRIOR_NOISE.levels())) / np.log(PRIOR_FACTOR)
    return off


def _likeliest(model: MixedModel, variances: Variances, logs: Array, present: Array) -> tuple[Array, Array]:
    """Logarithms (2,) of the likeliest levels and their deviations (2,), by Fisher scoring."""
    prior = 1 / np.log(PRIOR_FACTOR) ** 2
    for _ in range(ITERATIONS):
        levels = np.where(present, np.exp(2 * logs), 0.0)
        found = redundancy(model, replace(variances, rotation=float(levels[0]), translation=float(levels[1])))
        gradient = levels * (found.quadratic - found.trace) - prior * (logs - np.log(PRIOR_NOISE.levels()))
        information = 2 * levels[:, None] * found.fisher * levels + prior * np.eye(2)
        step = np.where(present, np.linalg.solve(information, gradient * present), 0.0)
        logs = logs + np.clip(step, -1.0, 1.0)
        if np.all(np.abs(step) < SETTLED):
            break
    return logs, 1 / np.sqrt(np.diagonal(information))


def _at(model: MixedModel, variances: Variances, deviations: Array) -> _At:
    """At robot deviations (k, 2)."""
    pixel, spread = variances.pixel, np.repeat(deviations, 3, axis=1)[:, None, :, None]  # (k, 1, 6, 1)
    spread_t = np.swapaxes(spread, 2, 3)
    scaled = spread * model.UU * spread_t / pixel + np.eye(6)
    K = spread * np.linalg.inv(scaled) * spread_t / pixel  # (k, n, 6, 6)
    p, columns, total = model.shared, model.UAy, model.total
    explained = summed_products(columns, K @ columns)
    known = model.known_information(variances)
    information = (total[:p, :p] - explained[:, :p, :p]) / pixel + np.diag(known)
    gradient = (total[:p, p] - explained[:, :p, p]) / pixel + known * model.offset
    covariance, log_S = scaled_inverse_and_log_determinant(information, MIN_EIGENVALUE)
    b = -(covariance @ gradient[..., None])[..., 0]
    log_V = np.linalg.slogdet(scaled)[1].sum(axis=1)
    quadratic = (
        (total[p, p] - explained[:, p, p]) / pixel + np.sum(known * model.offset**2) + np.sum(b * gradient, axis=1)
    )
    return _At(-0.5 * (log_V + log_S + quadratic), b, covariance)


def log_restricted(model: MixedModel, variances: Variances) -> float:
    """Log of the restricted likelihood at the given levels, up to what no model changes."""
    robot = np.sqrt([[variances.rotation, variances.translation]])
    return float(_at(model, variances, robot).log_likelihood[0]) + _constant(model, variances)


def _constant(model: MixedModel, variances: Variances) -> float:
    """What the robot's two levels do not change."""
    known = model.known_information(variances)
    return 0.5 * float(np.log(known[known > 0]).sum()) - 0.5 * float(model.count.sum() * np.log(variances.pixel))
