"""Test for errors that all views share: an offset of the given principal point, robot errors that follow the pose.

Each model is fitted where a score test finds that it might explain something, and adopted only where the restricted
likelihood, which penalises every unknown, improves by MIN_LOG_LIKELIHOOD_GAIN, because an unneeded unknown costs
accuracy. Without such errors a likelihood ratio exceeds e^g with a probability below e^-g (Markov's inequality).
"""

from dataclasses import replace

import numpy as np

from calibration.likelihood.augmented_model import AugmentedModel
from calibration.likelihood.chain import Chain
from calibration.likelihood.estimate import Estimate
from calibration.likelihood.mixed_model import MixedModel, Step, Variances, solve, with_trend
from calibration.likelihood.noise_marginalisation import Marginal, marginalise, restricted_log_likelihood
from calibration.likelihood.systematic_errors import CENTRE_INDICES, NO_SYSTEMATIC_ERRORS, SystematicErrors, trend_basis
from calibration.likelihood.variance_components import estimate_variances
from calibration.linear_algebra import covariance_of, squared_distances
from calibration.observations.reprojection import INTRINSICS
from calibration.preprocessing.prepare import PreparedSession
from calibration.solver.shared_corner_errors import shared_corner_sigma_px, variance_by_shared_corners
from calibration.solver.view_outliers import Selection
from calibration.transforms import Array, adjoint, inverse

MIN_VIEWS, MIN_TREND_VIEWS = 5, 12
"""Least views for the principal point and for the trend, which has 36 coefficients."""

MIN_LOG_LIKELIHOOD_GAIN = 6.0
"""Least gain of log-likelihood for adopting a model; exceeded by chance in less than one of 400 sessions."""

PRIOR_OFF_PROBABILITY = 0.1
"""Prior probability that a given principal point is off, and that a target's size is."""

SIZE_SIGMA = 2e-3
"""Standard deviation of a target's size that is off, as a share: printers and paper."""

MIN_CORNER_SIGMA_PX = 0.02
"""Standard deviation per axis of errors of the corners that are alike in all views, by light, lens and detector: of a
given principal point, and of a corner's place about the target's middle."""

MIN_FIRST_LOG_RATIO = -6.0
"""Log-likelihood difference, at the noise levels of the exact-camera model, below which the model with a shifted
principal point is not fitted at all: no re-estimated noise makes up for more."""

Assumption = tuple[bool, bool]
"""(principal point unknown, trend of the robot's errors)."""

Models = dict[Assumption, MixedModel]

TREND_SQUARES = 2.0
"""Mean sum of squares of the trend's regressors over the views: of places and of orientations, each of spread 1."""

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


def widen_by_shared_errors(
    prepared: PreparedSession, selection: Selection, wider: AugmentedModel, models: Models
) -> Selection:
    """The same X with its covariance widened by the errors that all views may share though none is significant.

    For the given principal point, for the target's size and for a trend of the robot's errors, each by its posterior
    probability, and for the errors of the corners and the size that are never zero. Probability and shift of X follow
    from the priors and the data, so that the uncertainty also holds where the data do not decide. X itself is changed
    only by significant errors. `wider` is the model behind `models`.
    """
    best, errors = selection.best, prepared.systematic_errors
    errors = replace(errors, trend=errors.trend and TREND in models)  # rejected views may leave too few for a trend
    exact = errors.apply(wider.restrict_to(best.free), best.free, best.camera, best.chain.base_T_flange)
    more = np.zeros((12, 12))
    if errors.given_camera is None and CENTRE_OFF in models:
        more += _variance_if_off(exact, _both(models) if errors.trend else models[CENTRE_OFF], best.variances)
    if len(exact.count) >= MIN_VIEWS and not best.free[INTRINSICS]:
        more += _variance_if_off(exact, _with_prior_errors(errors, wider, SIZE_SIGMA), best.variances)
        centre_sigma_px = MIN_CORNER_SIGMA_PX if errors.given_camera is None and CENTRE_OFF in models else 0.0
        small = MIN_CORNER_SIGMA_PX / _corner_radius_px(prepared)
        more += _variance_of(_with_prior_errors(errors, wider, small, centre_sigma_px), exact, best.variances)
    more += _variance_by_trend(exact, best, adopted=errors.trend)
    rows = prepared.take(selection.used)
    distance_mm = float(np.median(np.linalg.norm(rows.camera_T_target[:, :3, 3], axis=1)))
    more[:6, :6] += variance_by_shared_corners(shared_corner_sigma_px(rows, best), best.camera, distance_mm)
    covariance = best.step.covariance.copy()
    covariance[:12, :12] += more
    return replace(selection, best=replace(best, step=replace(best.step, covariance=covariance)))


def widen_by_given(selection: Selection) -> Selection:
    """The same X with the variance of the coordinate that was given along the only axis of rotation."""
    chain, step = selection.best.chain, selection.best.step
    if chain.given is None:
        return selection
    covariance = step.covariance.copy()
    covariance[:12, :12] += chain.given.covariance(chain.mount_T_camera, chain.anchor_T_target)
    return replace(selection, best=replace(selection.best, step=replace(step, covariance=covariance)))


def _variance_if_off(exact_model: MixedModel, off_model: MixedModel, variances: Variances) -> Array:
    """What an error adds to the covariance (12, 12) of X and the target's pose, by its posterior probability."""
    at_first_sight = restricted_log_likelihood(off_model, variances) - restricted_log_likelihood(exact_model, variances)
    if at_first_sight < MIN_FIRST_LOG_RATIO:
        return np.zeros((12, 12))
    exact, off = (marginalise(model, estimate_variances(model, variances)) for model in (exact_model, off_model))
    return _probability_of(off, exact) * _difference(off, exact)


def _probability_of(off: Marginal, exact: Marginal) -> float:
    odds = np.log(PRIOR_OFF_PROBABILITY / (1 - PRIOR_OFF_PROBABILITY)) + off.log_evidence - exact.log_evidence
    return float(1 / (1 + np.exp(-np.clip(odds, -500.0, 500.0))))


def _difference(off: Marginal | Step, exact: Marginal | Step) -> Array:
    """What an error adds to the covariance (12, 12) of X and the target's pose where X is taken without it."""
    shift = off.b[:12] - exact.b[:12]
    return np.asarray(off.covariance[:12, :12] - exact.covariance[:12, :12] + np.outer(shift, shift))


def _variance_by_trend(exact_model: MixedModel, best: Estimate, *, adopted: bool) -> Array:
    """What robot errors that follow the pose add to the covariance (12, 12), by their probability.

    X takes up the part of them that is alike in all views. It shows in no residual and is taken to be as large as the
    part that follows the pose. `adopted`: whether the trend is in the model already.
    """
    chain, more, share, levels = best.chain, np.zeros((12, 12)), 1.0, best.variances
    if not adopted:
        basis = trend_basis(chain.base_T_flange)
        if len(basis) < MIN_TREND_VIEWS:
            return more
        trend = with_trend(exact_model, basis)
        if not _trend_shows(trend, exact_model.unknowns, best):
            return more
        levels = _levels(trend, best)
        exact, off = marginalise(exact_model, best.variances), marginalise(trend, levels)
        share = _probability_of(off, exact)
        more = share * _difference(off, exact)
    alike = TREND_SQUARES * np.repeat([levels.trend_rotation, levels.trend_translation], 3)
    by_camera = adjoint(inverse(_centre_T_camera(chain)))
    more[:6, :6] += share * (by_camera * alike) @ by_camera.T
    return more


def _centre_T_camera(chain: Chain) -> Array:
    """The camera (4, 4) in the frame of the mount whose origin is the flange's, in the base its mean place."""
    if chain.setup == "eye-in-hand":
        return chain.mount_T_camera
    moved: Array = chain.mount_T_camera.copy()
    moved[:3, 3] -= chain.base_T_flange[:, :3, 3].mean(axis=0)
    return moved


def _with_prior_errors(
    errors: SystematicErrors, wider: AugmentedModel, size_sigma: float, centre_sigma_px: float = 0.0
) -> MixedModel:
    """The model with these errors, an unknown size of the target, and an unknown principal point with a level above 0.

    Both are about the described ones, with priors of these standard deviations.
    """
    best, free = wider.best, wider.best.free.copy()
    free[INTRINSICS] = True
    if centre_sigma_px:
        free[list(CENTRE_INDICES)] = True
    model = wider.restrict_to(free)
    known = model.prior_information.copy()
    if centre_sigma_px:
        known[12 + np.flatnonzero(np.isin(np.flatnonzero(free), CENTRE_INDICES))] = 1 / centre_sigma_px**2
    known[-1] = 1 / size_sigma**2
    return errors.apply(replace(model, prior_information=known), free, best.camera, best.chain.base_T_flange)


def _variance_of(off_model: MixedModel, exact_model: MixedModel, variances: Variances) -> Array:
    """What a certain error adds to the covariance (12, 12) of X and the target's pose, at these noise levels."""
    return _difference(solve(off_model, variances), solve(exact_model, variances))


def _corner_radius_px(prepared: PreparedSession) -> float:
    """RMS distance per axis of the target's corners from their middle, in px, at the median distance."""
    spread = float(np.sqrt(np.mean(np.var(prepared.nominal_mm[:, :2], axis=0))))
    distance = float(np.median(np.linalg.norm(prepared.camera_T_target[:, :3, 3], axis=1)))
    return spread / distance * float(prepared.camera.matrix[0, 0])


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
