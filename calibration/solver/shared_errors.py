"""Errors that all views share: adopted where significant, and counted in the uncertainty where not.

Errors of the robot that follow its pose (a trend): the model is adopted only where the restricted likelihood, which
penalises every unknown, improves by MIN_LOG_LIKELIHOOD_GAIN, because an unneeded unknown costs accuracy. Without such
errors a likelihood ratio exceeds e^g with a probability below e^-g (Markov's inequality). Where lens and target explain
the errors as well, the trend is not adopted, and its probability widens the uncertainty.

Errors of the corners that are alike in all views, by light, lens and detector: each corner's mean residual over the
views is its noise, which falls with the number of views, and what the views share. The part that moves or scales every
picture alike is taken up by the poses and shows in no residual; it is taken to be as large per corner as the part that
shows.
"""

from dataclasses import dataclass, replace

import numpy as np

from calibration.camera import CameraModel
from calibration.likelihood.chain import Chain
from calibration.likelihood.estimate import Estimate
from calibration.likelihood.mixed_model import MixedModel, Variances, trend_basis, with_trend
from calibration.likelihood.noise_marginalisation import marginalise, restricted_log_likelihood
from calibration.likelihood.variance_components import estimate_variances
from calibration.observations.reprojection import pixel_residuals
from calibration.preprocessing.prepare import PreparedSession
from calibration.solver.view_outliers import Selection
from calibration.transforms import Array, adjoint, inverse

MIN_TREND_VIEWS = 12
"""Least views of a trend, which has 36 coefficients."""

MIN_LOG_LIKELIHOOD_GAIN = 6.0
"""Least gain of log-likelihood for adopting a trend; exceeded by chance in less than one of 400 sessions."""

PRIOR_PROBABILITY = 0.1
"""Prior probability of a trend."""

TREND_SQUARES = 2.0
"""Mean sum of squares of the trend's regressors over the views: of places and of orientations, each of spread 1."""


@dataclass(frozen=True, eq=False)
class Trend:
    """The model of an estimate with a trend of the robot's errors, and its noise levels.

    `gain`: of the restricted log-likelihood over the estimate without it, less Schwarz's penalty for two levels.
    """

    model: MixedModel
    levels: Variances
    gain: float

    @property
    def significant(self) -> bool:
        """Whether it is adopted."""
        return self.gain >= MIN_LOG_LIKELIHOOD_GAIN


def fit_trend(best: Estimate) -> Trend | None:
    """The trend beside an estimate without one; None for few views."""
    basis = trend_basis(best.chain.base_T_flange)
    if len(basis) < MIN_TREND_VIEWS:
        return None
    model, first = with_trend(best.model, basis), best.variances
    # Those of a trend start from the levels of the single views.
    start = replace(first, trend_rotation=first.rotation + 1e-12, trend_translation=first.translation + 1e-6)
    levels = estimate_variances(model, start)
    penalty = float(np.log(6 * len(basis)))
    gain = restricted_log_likelihood(model, levels) - penalty - restricted_log_likelihood(best.model, first)
    return Trend(model, levels, gain)


def widen_by_shared_errors(prepared: PreparedSession, selection: Selection, trend: Trend | None) -> Selection:
    """The same X with its covariance widened by errors that all views may share though none is significant.

    `trend`: of the selection's estimate, or the one that it contains; None for few views.

    For a trend of the robot's errors by its posterior probability, and for errors of the corners that are alike in all
    views as far as the residuals show them.
    """
    best = selection.best
    more = np.zeros((12, 12)) if trend is None else _variance_by_trend(best, prepared, trend)
    rows = prepared.take(selection.used)
    distance_mm = float(np.median(np.linalg.norm(rows.camera_T_target[:, :3, 3], axis=1)))
    more[:6, :6] += variance_by_shared_corners(shared_corner_sigma_px(rows, best), best.camera, distance_mm)
    return selection.widened(more)


def widen_by_given(selection: Selection) -> Selection:
    """The same X with the variance of the coordinate that was given along the only axis of rotation."""
    chain = selection.best.chain
    if chain.given is None:
        return selection
    return selection.widened(chain.given.covariance(chain.mount_T_camera, chain.anchor_T_target))


def _variance_by_trend(best: Estimate, prepared: PreparedSession, trend: Trend) -> Array:
    """What robot errors that follow the pose add to the covariance (12, 12), by their probability.

    X takes up the part of them that is alike in all views. It shows in no residual and is taken to be as large as the
    part that follows the pose.
    """
    chain, more, share, levels = best.chain, np.zeros((12, 12)), 1.0, best.variances
    if not best.model.trend_terms:
        levels = trend.levels
        exact, off = (
            marginalise(one, at, prepared.belief) for one, at in ((best.model, best.variances), (trend.model, levels))
        )
        odds = np.log(PRIOR_PROBABILITY / (1 - PRIOR_PROBABILITY)) + off.log_evidence - exact.log_evidence
        share = float(1 / (1 + np.exp(-np.clip(odds, -500.0, 500.0))))
        shift = off.b[:12] - exact.b[:12]
        more = share * (off.covariance[:12, :12] - exact.covariance[:12, :12] + np.outer(shift, shift))
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


MIN_CORNER_VIEWS = 3
"""Least views of a corner whose mean is taken."""

SIGNIFICANT_SIGMA = 3.0
"""Standard deviations of the mean square by which it must exceed that of noise."""


def shared_corner_sigma_px(rows: PreparedSession, best: Estimate) -> float:
    """Standard deviation per axis of errors that the views share; 0 where they are not significant.

    `rows`: the views of the estimate `best`.
    """
    seen = rows.seen
    residuals = pixel_residuals(best.seen(seen), best.camera, best.chain.camera_T_target())
    used = seen.weights > 0
    ids, count = seen.ids[used], int(seen.ids.max()) + 1
    views = np.bincount(ids, minlength=count)
    often = views >= MIN_CORNER_VIEWS
    if not np.any(often):
        return 0.0
    sums = np.stack([np.bincount(ids, residuals[used][:, axis], minlength=count) for axis in (0, 1)], axis=1)
    squares = (sums[often] / views[often, None]) ** 2
    noise = best.variances.pixel / views[often]
    excess = float(np.mean(squares) - np.mean(noise))
    deviation = float(np.sqrt(np.mean(noise**2) / len(noise)))  # of a mean of 2 k squares, each of variance 2 noise²
    return float(np.sqrt(excess)) if excess > SIGNIFICANT_SIGMA * deviation else 0.0


def variance_by_shared_corners(sigma_px: float, camera: CameraModel, distance_mm: float) -> Array:
    """The covariance (6, 6) of X by a common shift, turn and scale of all pictures of this size at their rim.

    In the camera frame, [rad, mm]: a shift turns the line of sight, a scale moves the target along it.
    """
    focal_px, half_px = float(np.sqrt(np.prod(np.diagonal(camera.matrix)[:2]))), 0.5 * max(camera.image_size)
    shift, rim = sigma_px / focal_px, sigma_px / half_px
    return np.diag(np.square([shift, shift, rim, 0.0, 0.0, rim * distance_mm]))
