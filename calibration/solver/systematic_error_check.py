"""Test for errors that all views share: an offset of the given principal point, robot errors that follow the pose.

Each model is fitted where a score test finds that it might explain something, and adopted only where the restricted
likelihood, which penalises every unknown, improves by MIN_LOG_LIKELIHOOD_GAIN, because an unneeded unknown costs
accuracy. Without such errors a likelihood ratio exceeds e^g with a probability below e^-g (Markov's inequality).
"""

from dataclasses import replace

import numpy as np

from calibration.likelihood.augmented_model import AugmentedModel
from calibration.likelihood.estimate import Estimate
from calibration.likelihood.mixed_model import MixedModel, Variances, solve, with_trend
from calibration.likelihood.noise_marginalisation import marginalise, restricted_log_likelihood
from calibration.likelihood.systematic_errors import CENTRE_INDICES, NO_SYSTEMATIC_ERRORS, SystematicErrors, trend_basis
from calibration.likelihood.variance_components import estimate_variances
from calibration.linear_algebra import covariance_of, squared_distances
from calibration.observations.reprojection import INTRINSICS
from calibration.preprocessing.prepare import PreparedSession
from calibration.solver.view_outliers import Selection

MIN_VIEWS, MIN_TREND_VIEWS = 5, 12
"""Least views for the principal point and for the trend, which has 36 coefficients."""

MIN_LOG_LIKELIHOOD_GAIN = 6.0
"""Least gain of log-likelihood for adopting a model; exceeded by chance in less than one of 400 sessions."""

PRIOR_OFF_PROBABILITY = 0.1
"""Prior probability that a given principal point is off."""

MIN_FIRST_LOG_RATIO = -6.0
"""Log-likelihood difference, at the noise levels of the exact-camera model, below which the model with a shifted
principal point is not fitted at all: no re-estimated noise makes up for more."""

Assumption = tuple[bool, bool]
"""(principal point unknown, trend of the robot's errors)."""

Models = dict[Assumption, MixedModel]

NEITHER, CENTRE_OFF, TREND, BOTH = (False, False), (True, False), (False, True), (True, True)

MIN_CENTRE_CHI2, MIN_TREND_SIGMA = 8.0, 2.0
"""Thresholds of the score tests: chi-square with two degrees of freedom; standard deviations. Low, since at this point
the noise levels still contain the error."""


def build_models(prepared: PreparedSession, wider: AugmentedModel) -> Models:
    """The linearised session at the estimate, under each assumption for which there are enough views."""
    best = wider.best
    base_T_flange = best.chain.base_T_flange
    plain = wider.restrict_to(best.free)
    models = {NEITHER: plain}
    if not np.any(best.free[:INTRINSICS]):
        free = best.free.copy()
        free[list(CENTRE_INDICES)] = True
        models[CENTRE_OFF] = SystematicErrors(prepared.camera).apply(
            wider.restrict_to(free), free, best.camera, base_T_flange
        )
    if len(base_T_flange) >= MIN_TREND_VIEWS:
        models[TREND] = with_trend(plain, trend_basis(base_T_flange))
    return models


def find_systematic_errors(
    prepared: PreparedSession, selection: Selection, models: Models
) -> tuple[SystematicErrors, Variances]:
    """The systematic errors that are significant, and the noise levels estimated with them."""
    best, n = selection.best, int(np.count_nonzero(selection.used))
    neither = NO_SYSTEMATIC_ERRORS, best.variances
    if n < MIN_VIEWS:
        return neither
    candidates = {
        what: model for what, model in models.items() if _passes_score_test(what, model, models[NEITHER], best)
    }
    if len(candidates) < 2:
        return neither
    if CENTRE_OFF in models and TREND in models:
        candidates[BOTH] = _both(models)
    levels = {what: _levels(model, best) for what, model in candidates.items()}
    scores = {what: _score(model, levels[what], n) for what, model in candidates.items()}
    centre, trend = likeliest = max(scores, key=lambda what: scores[what])
    if scores[likeliest] - scores[NEITHER] < MIN_LOG_LIKELIHOOD_GAIN:
        return neither
    return SystematicErrors(prepared.camera if centre else None, trend), levels[likeliest]


def with_systematic_errors(prepared: PreparedSession, errors: SystematicErrors) -> PreparedSession:
    """The session with the parameters of these errors among the unknowns."""
    free = prepared.free.copy()
    free[list(CENTRE_INDICES)] |= errors.given_camera is not None
    return replace(prepared, free=free, systematic_errors=errors)


def widen_by_centre_error(prepared: PreparedSession, selection: Selection, models: Models) -> Selection:
    """The same X with its covariance widened by the posterior probability that the given principal point is off.

    Probability and shift of X follow from PRIOR_OFF_PROBABILITY and the data, so that the uncertainty also holds where
    the data do not decide. X itself is changed only by significant errors.
    """
    best, trend = selection.best, prepared.systematic_errors.trend
    if prepared.systematic_errors.given_camera is not None or CENTRE_OFF not in models:
        return selection
    trend = trend and TREND in models  # rejected views may leave too few for a trend
    exact_model, off_model = (models[TREND], _both(models)) if trend else (models[NEITHER], models[CENTRE_OFF])
    at_first_sight = restricted_log_likelihood(off_model, best.variances) - restricted_log_likelihood(
        exact_model, best.variances
    )
    if at_first_sight < MIN_FIRST_LOG_RATIO:
        return selection
    exact, off = (marginalise(model, estimate_variances(model, best.variances)) for model in (exact_model, off_model))
    odds = np.log(PRIOR_OFF_PROBABILITY / (1 - PRIOR_OFF_PROBABILITY)) + off.log_evidence - exact.log_evidence
    share = float(1 / (1 + np.exp(-np.clip(odds, -500.0, 500.0))))
    shift = off.b[:12] - exact.b[:12]
    wider = off.covariance[:12, :12] - exact.covariance[:12, :12] + np.outer(shift, shift)
    covariance = best.step.covariance.copy()
    covariance[:12, :12] += share * wider
    return replace(selection, best=replace(best, step=replace(best.step, covariance=covariance)))


def _both(models: Models) -> MixedModel:
    return with_trend(models[CENTRE_OFF], models[TREND].basis)


def _passes_score_test(what: Assumption, model: MixedModel, plain: MixedModel, best: Estimate) -> bool:
    if what == CENTRE_OFF:
        return _centre_moves(model, best)
    if what == TREND:
        return _trend_shows(model, plain.unknowns, best)
    return what == NEITHER


def _centre_moves(model: MixedModel, best: Estimate) -> bool:
    step = solve(model, best.variances)
    columns = np.flatnonzero(model.prior_information > 0)
    shift, covariance = step.b[columns], step.covariance[np.ix_(columns, columns)]
    return bool(squared_distances(shift, covariance) > MIN_CENTRE_CHI2)


def _trend_shows(model: MixedModel, p: int, best: Estimate) -> bool:
    """A score test: coefficients' gradient g with information S has g' diag(S)^-1 g at its mean k, without a trend.

    `p`: the unknowns before the trend's coefficients.
    """
    step, known = solve(model, best.variances), model.full_prior_information(best.variances)
    information, gradient = step.information - np.diag(known), step.gradient - known * model.prior_offset
    across = information[p:, :p] @ covariance_of(information[:p, :p])
    score = gradient[p:] - across @ gradient[:p]
    spread = information[p:, p:] - across @ information[:p, p:]
    scale = np.where(np.diagonal(spread) > 1e-9 * np.diagonal(information)[p:], np.diagonal(spread), np.inf) ** -0.5
    correlation = scale[:, None] * spread * scale
    above = float(np.sum((scale * score) ** 2) - np.trace(correlation))
    return above > MIN_TREND_SIGMA * float(np.sqrt(2 * np.sum(correlation**2)))


def _levels(model: MixedModel, best: Estimate) -> Variances:
    """The most likely noise levels; those of a trend start from the levels of the single views."""
    first = best.variances
    if model.trend_terms:
        first = replace(first, trend_rotation=first.rotation + 1e-12, trend_translation=first.translation + 1e-6)
    return estimate_variances(model, first)


def _score(model: MixedModel, levels: Variances, views: int) -> float:
    """The restricted log-likelihood, less Schwarz's penalty for the two further levels of a trend."""
    return restricted_log_likelihood(model, levels) - (float(np.log(6 * views)) if model.trend_terms else 0.0)
