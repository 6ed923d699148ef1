"""Does the whole session err in common: is the given principal point off, do the robot's errors follow its pose?

Both models are tried where a score test says that they might explain something, and taken up only where the restricted
likelihood, which pays for every unknown, is convinced; because an unneeded unknown costs accuracy. Under a session
without such errors a likelihood ratio exceeds e^g with a chance below e^-g (Markov's inequality).
"""

from dataclasses import replace

import numpy as np

from calibration.likelihood.augmented_model import Widened
from calibration.likelihood.estimate import Estimate
from calibration.likelihood.mixed_model import MixedModel, Variances, solve, with_trend
from calibration.likelihood.noise_marginalisation import averaged, log_restricted
from calibration.likelihood.systematic_errors import CENTRE, NO_DOUBT, Doubt, trend_basis
from calibration.likelihood.variance_components import estimate_variances
from calibration.linear_algebra import covariance_of, squared_distances
from calibration.observations.reprojection import INTRINSICS
from calibration.preprocessing.prepare import Prepared
from calibration.solver.view_outliers import Selection

FEWEST_VIEWS, FEWEST_TREND_VIEWS = 5, 12
"""A trend has 36 coefficients; fewer views do not tell it from chance."""

GAIN = 6.0
"""Log-likelihood: by chance less than once in 400 sessions."""

OFF = 0.1
"""How likely a given principal point is off beforehand: one camera in ten."""

OUT_OF_THE_QUESTION = -6.0
"""Log-likelihood: the estimate's noise levels may have taken some of the blame, but not so much."""

What = tuple[bool, bool]
"""Whether the centre is doubted, whether a trend is."""

Assumptions = dict[What, MixedModel]

NOTHING, CENTRE_OFF, TREND, BOTH = (False, False), (True, False), (False, True), (True, True)

WORTH_A_TRIAL_CENTRE, WORTH_A_TRIAL_TREND = 8.0, 2.0
"""Chi-square of two; deviations of a score test. Low, for the noise has taken the blame so far."""


def assumptions(prepared: Prepared, wider: Widened) -> Assumptions:
    """The session at the estimate, under each assumption that it has enough views to look at."""
    best = wider.best
    base_T_flange = best.chain.base_T_flange
    plain = wider.freeing(best.free)
    models = {NOTHING: plain}
    if not np.any(best.free[:INTRINSICS]):
        free = best.free.copy()
        free[list(CENTRE)] = True
        models[CENTRE_OFF] = Doubt(prepared.camera).applied(wider.freeing(free), free, best.camera, base_T_flange)
    if len(base_T_flange) >= FEWEST_TREND_VIEWS:
        models[TREND] = with_trend(plain, trend_basis(base_T_flange))
    return models


def shared_errors(prepared: Prepared, selection: Selection, models: Assumptions) -> tuple[Doubt, Variances]:
    """Which of the two are there beyond doubt, and the noise levels that go with them."""
    best, n = selection.best, int(np.count_nonzero(selection.used))
    neither = NO_DOUBT, best.variances
    if n < FEWEST_VIEWS:
        return neither
    worth = {what: model for what, model in models.items() if _worth_a_trial(what, model, models[NOTHING], best)}
    if len(worth) < 2:
        return neither
    if CENTRE_OFF in models and TREND in models:
        worth[BOTH] = _both(models)
    levels = {what: _levels(model, best) for what, model in worth.items()}
    scores = {what: _score(model, levels[what], n) for what, model in worth.items()}
    centre, trend = likeliest = max(scores, key=lambda what: scores[what])
    if scores[likeliest] - scores[NOTHING] < GAIN:
        return neither
    return Doubt(prepared.camera if centre else None, trend), levels[likeliest]


def doubted(prepared: Prepared, doubt: Doubt) -> Prepared:
    """The same session with what is doubted unknown."""
    free = prepared.free.copy()
    free[list(CENTRE)] |= doubt.given is not None
    return replace(prepared, free=free, doubt=doubt)


def doubting_the_centre(prepared: Prepared, selection: Selection, models: Assumptions) -> Selection:
    """The same X, its covariance widened by the chance that the given principal point is off after all.

    How likely that is, and where X would be then, is what experience and the data say: the uncertainty holds also where
    the data cannot tell. X itself is moved by what is beyond doubt only.
    """
    best, trend = selection.best, prepared.doubt.trend
    if prepared.doubt.given is not None or CENTRE_OFF not in models:
        return selection
    trend = trend and TREND in models  # views that were rejected since may leave too few to tell
    exact_model, off_model = (models[TREND], _both(models)) if trend else (models[NOTHING], models[CENTRE_OFF])
    at_first_sight = log_restricted(off_model, best.variances) - log_restricted(exact_model, best.variances)
    if at_first_sight < OUT_OF_THE_QUESTION:
        return selection
    exact, off = (averaged(model, estimate_variances(model, best.variances)) for model in (exact_model, off_model))
    odds = np.log(OFF / (1 - OFF)) + off.log_evidence - exact.log_evidence
    share = float(1 / (1 + np.exp(-np.clip(odds, -500.0, 500.0))))
    shift = off.b[:12] - exact.b[:12]
    wider = off.covariance[:12, :12] - exact.covariance[:12, :12] + np.outer(shift, shift)
    covariance = best.step.covariance.copy()
    covariance[:12, :12] += share * wider
    return replace(selection, best=replace(best, step=replace(best.step, covariance=covariance)))


def _both(models: Assumptions) -> MixedModel:
    return with_trend(models[CENTRE_OFF], models[TREND].basis)


def _worth_a_trial(what: What, model: MixedModel, plain: MixedModel, best: Estimate) -> bool:
    if what == CENTRE_OFF:
        return _centre_moves(model, best)
    if what == TREND:
        return _trend_shows(model, plain.shared, best)
    return what == NOTHING


def _centre_moves(model: MixedModel, best: Estimate) -> bool:
    step = solve(model, best.variances)
    columns = np.flatnonzero(model.known > 0)
    moved, doubt = step.b[columns], step.covariance[np.ix_(columns, columns)]
    return bool(squared_distances(moved, doubt) > WORTH_A_TRIAL_CENTRE)


def _trend_shows(model: MixedModel, p: int, best: Estimate) -> bool:
    """A score test: coefficients' gradient g with information S has g' diag(S)^-1 g at its mean k, without a trend.

    `p`: the unknowns before the trend's coefficients.
    """
    step, known = solve(model, best.variances), model.known_information(best.variances)
    information, gradient = step.information - np.diag(known), step.gradient - known * model.offset
    across = information[p:, :p] @ covariance_of(information[:p, :p])
    score = gradient[p:] - across @ gradient[:p]
    spread = information[p:, p:] - across @ information[:p, p:]
    scale = np.where(np.diagonal(spread) > 1e-9 * np.diagonal(information)[p:], np.diagonal(spread), np.inf) ** -0.5
    correlation = scale[:, None] * spread * scale
    above = float(np.sum((scale * score) ** 2) - np.trace(correlation))
    return above > WORTH_A_TRIAL_TREND * float(np.sqrt(2 * np.sum(correlation**2)))


def _levels(model: MixedModel, best: Estimate) -> Variances:
    """The likeliest noise levels; a trend's are sought from those of each view alone."""
    first = best.variances
    if model.trend:
        first = replace(first, trend_rotation=first.rotation + 1e-12, trend_translation=first.translation + 1e-6)
    return estimate_variances(model, first)


def _score(model: MixedModel, levels: Variances, views: int) -> float:
    """The log-likelihood; a trend's two more levels are paid for by Schwarz's criterion."""
    return log_restricted(model, levels) - (float(np.log(6 * views)) if model.trend else 0.0)
