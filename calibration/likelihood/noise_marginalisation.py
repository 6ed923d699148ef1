"""Marginalisation of X over the robot's noise levels and over the components of the nuisances' prior.

With few views an estimate of a level may be a tenth of the truth, and for an exact robot it is above zero half of the
time. So X and its covariance are averaged over the levels, weighted by the restricted likelihood times a prior: noise
log-normal about what is believed of the robot, or none at all in the rotation, in the translation or in both. The
influence of the prior falls with the number of views. Of lens and target the prior is a mixture of normal densities
(`calibration.knowledge`): with X and the target's pose eliminated at each pair of levels, each component is a small
linear problem, and X, its covariance and the levels are the moments of the whole mixture.
Source: D. Harville, "Bayesian inference for variance components using only error contrasts", Biometrika 61, 1974.
"""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from calibration.kinematics.robot_accuracy import MIN_REPEATABILITY, USUAL_BELIEF, NoiseBelief, RobotNoise
from calibration.knowledge import PriorMixture
from calibration.likelihood.mixed_model import MixedModel, Variances, sum_products
from calibration.likelihood.variance_components import redundancy
from calibration.linear_algebra import MIN_EIGENVALUE, inverse_or_pseudo_inverse, scaled_inverse_and_log_determinant
from calibration.solution import ArmScale
from calibration.transforms import Array

MAX_PRIOR_VIEWS = 7
"""Most views for which the noise levels themselves are averaged; more views estimate them better than the prior."""

EXACT_PROBABILITY = 0.02
"""Prior probability that rotations are exact, that translations are, and that both are; for simulated cells."""

NODES = ((7, 9, 3.0), (20, 5, 2.2), (40, 3, 1.3))
"""(views up to, nodes for each level, reach in standard deviations); one node for more views."""

ITERATIONS, STEP_TOLERANCE = 8, 0.05
MAX_LOG_LIKELIHOOD_DEFICIT = 30.0
"""Branches whose log-likelihood is this far below the best are skipped."""


@dataclass(frozen=True, eq=False)
class Marginal:
    """Mean of the shared step (p,), its covariance (p, p), and the squares of the mean standard deviations.

    `log_evidence` of the model, up to a constant common to all models. `belief`: in the noise, after the session.
    `prior_information` (p,): of the normal density that stands for the mixture there; `arm_scale` for a mixture.
    """

    b: Array
    covariance: Array
    variances: Variances
    log_evidence: float
    belief: NoiseBelief
    prior_information: Array
    arm_scale: ArmScale | None


@dataclass(frozen=True, eq=False)
class _AtLevels:
    """At k pairs of levels and m components of the prior: log of the evidence (k, m), steps (k, m, p).

    The unknowns of the mixture have the covariances `own` (k, m, q, q); the others, given them, `rest` (k, r, r), and
    follow them by -`slope` (k, r, q). `at` (q,), `others` (r,): their places among p.
    """

    log_evidence: Array
    b: Array
    own: Array
    rest: Array
    slope: Array
    at: NDArray[np.intp]
    others: NDArray[np.intp]

    def mean_covariance(self, weights: Array) -> Array:
        """The mean covariance (p, p) by `weights` (k, m)."""
        p = len(self.at) + len(self.others)
        by_level = np.einsum("km,kmij->kij", weights, self.own)
        along = self.slope @ by_level
        found = np.zeros((p, p))
        found[np.ix_(self.others, self.others)] = np.einsum("k,kij->ij", weights.sum(axis=1), self.rest) + np.sum(
            along @ np.swapaxes(self.slope, 1, 2), axis=0
        )
        found[np.ix_(self.others, self.at)] = -along.sum(axis=0)
        found[np.ix_(self.at, self.others)] = -along.sum(axis=0).T
        found[np.ix_(self.at, self.at)] = by_level.sum(axis=0)
        return found


def marginalise(model: MixedModel, variances: Variances, belief: NoiseBelief = USUAL_BELIEF) -> Marginal:
    """The marginal over the robot's two levels, about the given estimates, and over the components of the prior.

    The pixels' level is well determined. Raises FloatingPointError when no levels have a finite likelihood.
    """
    estimates = np.maximum(np.sqrt([variances.rotation, variances.translation]), 1e-2 * belief.median.levels())
    branches = [np.array(present) for present in product((True, False), repeat=2)]
    first = _at_levels(
        replace(model, mixture=None), variances, np.array([np.where(present, estimates, 0.0) for present in branches])
    ).log_evidence[:, 0]
    likely = np.where(np.isfinite(first), first, -np.inf)
    if likely.max() == -np.inf:
        raise FloatingPointError("no levels of the robot's noise have a finite likelihood")
    kept = likely >= likely.max() - MAX_LOG_LIKELIHOOD_DEFICIT  # 30 less is the same number beside 1e18
    nodes = [_nodes(model, variances, belief, estimates, present) for present in np.array(branches)[kept]]
    deviations, log_weights = (np.concatenate(parts) for parts in zip(*nodes, strict=True))
    found = _at_levels(model, variances, deviations)
    logs = log_weights[:, None] + found.log_evidence
    weights = np.exp(logs - logs.max())
    log_evidence = float(logs.max() + np.log(weights.sum())) + _constant(model, variances)
    weights /= weights.sum()
    mean = np.einsum("km,kmp->p", weights, found.b)
    off = found.b - mean
    covariance = found.mean_covariance(weights) + np.einsum("km,kmi,kmj->ij", weights, off, off, optimize=True)
    rotation, translation = (weights.sum(axis=1) @ deviations) ** 2
    levels = replace(variances, rotation=float(rotation), translation=float(translation))
    information = model.prior_information.copy()
    if model.mixture is not None:
        information[found.at] = weights.sum(axis=0) @ model.mixture.information
    scale = None if model.mixture is None else _arm_scale(model, model.mixture, found, weights, mean)
    after = update_belief(model, variances, belief, estimates)
    return Marginal(mean, covariance, levels, log_evidence, after, information, scale)


def update_belief(model: MixedModel, variances: Variances, belief: NoiseBelief, start: Array) -> NoiseBelief:
    """The belief in the robot's noise after the views of a model; `start` (2,): levels to search from, rad and mm."""
    logs, widths = _likeliest(model, variances, belief, np.log(start), np.ones(2, bool))
    rotation, translation = np.maximum(np.exp(logs), MIN_REPEATABILITY.levels()).tolist()
    by_rotation, by_translation = np.exp(widths).tolist()
    return replace(belief, median=RobotNoise(translation, rotation), factors=(by_rotation, by_translation))


def _arm_scale(model: MixedModel, prior: PriorMixture, found: _AtLevels, weights: Array, mean: Array) -> ArmScale:
    """The arm's part of the target's size, which is against the arm's lengths, by its share in each component."""
    size, share, width = int(found.at[prior.size]), prior.arm_share, 1 / prior.information[:, prior.size]
    logs = share * (found.b[:, :, size] + model.prior_offset[size])
    log = float(np.sum(weights * logs))
    own = found.own[:, :, prior.size, prior.size]
    variance = float(np.sum(weights * (share**2 * own + share * (1 - share) * width + (logs - log) ** 2)))
    of_x = -np.einsum("kij,kmj->kmi", found.slope[:, :6], found.own[:, :, :, prior.size])
    of_x += (logs - log)[..., None] / np.where(share == 0, 1.0, share)[:, None] * (found.b[:, :, :6] - mean[:6])
    return ArmScale(log, variance, np.einsum("km,kmi->i", weights * share, of_x))


def _nodes(
    model: MixedModel, variances: Variances, belief: NoiseBelief, estimates: Array, present: Array
) -> tuple[Array, Array]:
    """Standard deviations (k, 2) about the most likely ones, and the logarithms (k,) of their prior weights."""
    count, reach = next(((count, reach) for views, count, reach in NODES if len(model.count) <= views), (1, 0.0))
    if not np.any(present):
        return np.zeros((1, 2)), np.array([np.log(EXACT_PROBABILITY)])
    logs, widths = _likeliest(model, variances, belief, np.log(estimates), present)
    steps = np.linspace(-reach, reach, count)
    share = steps[1] - steps[0] if count > 1 else np.sqrt(2 * np.pi)
    grid = np.array(list(product(*(steps if here else [0.0] for here in present))))
    at = logs + widths * grid
    prior = -0.5 * belief.log_deviations(at) ** 2 - np.log(np.log(belief.factors) * np.sqrt(2 * np.pi))
    weight = ((prior + np.log(share * widths)) * present).sum(axis=1)
    return np.where(present, np.exp(at), 0.0), weight + np.log(
        1 - 3 * EXACT_PROBABILITY if np.all(present) else EXACT_PROBABILITY
    )


def _likeliest(
    model: MixedModel, variances: Variances, belief: NoiseBelief, logs: Array, present: Array
) -> tuple[Array, Array]:
    """Logarithms (2,) of the most likely levels and their standard deviations (2,), by Fisher scoring."""
    prior = 1 / np.log(belief.factors) ** 2
    for _ in range(ITERATIONS):
        levels = np.where(present, np.exp(2 * logs), 0.0)
        found = redundancy(model, replace(variances, rotation=float(levels[0]), translation=float(levels[1])))
        gradient = levels * (found.quadratic - found.trace) - prior * (logs - np.log(belief.median.levels()))
        information = 2 * levels[:, None] * found.fisher * levels + np.diag(prior)
        step = np.where(present, np.linalg.solve(information, gradient * present), 0.0)
        logs = logs + np.clip(step, -1.0, 1.0)
        if np.all(np.abs(step) < STEP_TOLERANCE):
            break
    return logs, 1 / np.sqrt(np.diagonal(information))


def _at_levels(model: MixedModel, variances: Variances, deviations: Array) -> _AtLevels:
    """Evidence, steps and covariances at standard deviations (k, 2) of the robot and each component of the prior."""
    pixel, spread = variances.pixel, np.repeat(deviations, 3, axis=1)[:, None, :, None]  # (k, 1, 6, 1)
    spread_t = np.swapaxes(spread, 2, 3)
    scaled = spread * model.UU * spread_t / pixel + np.eye(6)
    K = spread * inverse_or_pseudo_inverse(scaled) * spread_t / pixel  # (k, n, 6, 6)
    p, columns, total, mixture = model.unknowns, model.UAy, model.total, model.mixture
    at = np.arange(0) if mixture is None else model.mixture_at + np.arange(mixture.information.shape[1])
    others = np.setdiff1d(np.arange(p), at)
    explained = sum_products(columns, K @ columns)
    without = model.prior_information.copy()
    without[at] = 0.0  # the normal density that stands for the mixture
    beside = replace(model, prior_information=without).beside_views(variances)
    both = (total - explained) / pixel + beside  # (k, p + 1, p + 1)
    rest, log_rest = scaled_inverse_and_log_determinant(both[:, others][:, :, others], MIN_EIGENVALUE)
    slope = rest @ both[:, others][:, :, at]
    start = -(rest @ both[:, others, p, None])[..., 0]
    quadratic = both[:, p, p] + np.sum(start * both[:, others, p], axis=1)
    across = np.swapaxes(both[:, others][:, :, at], 1, 2)
    known = both[:, at][:, :, at] - across @ slope
    towards = both[:, at, p] + (across @ start[..., None])[..., 0]
    log_V = np.linalg.slogdet(scaled)[1].sum(axis=1)
    log_evidence = -0.5 * (log_V + log_rest + quadratic)[:, None]
    if mixture is None:
        own, z = np.zeros((len(deviations), 1, 0, 0)), np.zeros((len(deviations), 1, 0))
    else:
        precision, offset = mixture.information, model.prior_offset[at]
        own, log_own = scaled_inverse_and_log_determinant(
            known[:, None] + precision[:, None] * np.eye(len(at)), MIN_EIGENVALUE
        )
        pulled = towards[:, None] + precision * offset
        z = -(own @ pulled[..., None])[..., 0]
        log_evidence = log_evidence + mixture.log_weights + 0.5 * np.log(precision).sum(axis=1)
        log_evidence = log_evidence - 0.5 * (log_own + np.sum(z * pulled, axis=-1) + precision @ offset**2)
    b = np.zeros((*z.shape[:2], p))
    b[:, :, others] = start[:, None] - np.einsum("kij,kmj->kmi", slope, z)
    b[:, :, at] = z
    return _AtLevels(log_evidence, b, own, rest, slope, at, others)


def restricted_log_likelihood(model: MixedModel, variances: Variances) -> float:
    """Logarithm of the restricted likelihood at the given levels, up to a constant common to all models.

    A mixture counts as the normal density that stands for it.
    """
    robot = np.sqrt([[variances.rotation, variances.translation]])
    model = replace(model, mixture=None)
    return float(_at_levels(model, variances, robot).log_evidence[0, 0]) + _constant(model, variances)


def _constant(model: MixedModel, variances: Variances) -> float:
    """The part of the restricted log-likelihood that depends neither on the robot's two levels nor on the mixture."""
    known = model.full_prior_information(variances)
    if model.mixture is not None:
        known = np.delete(known, model.mixture_at + np.arange(model.mixture.information.shape[1]))
    return 0.5 * float(np.log(known[known > 0]).sum()) - 0.5 * float(model.count.sum() * np.log(variances.pixel))
