"""Initial guess of the maximum-likelihood estimate, from several closed forms that should lead to one optimum."""

from dataclasses import dataclass

import numpy as np

from calibration.closed_forms.kronecker import as_rotation
from calibration.closed_forms.one_axis import one_axis
from calibration.closed_forms.registry import CLOSED_FORMS
from calibration.errors import UndeterminedError
from calibration.likelihood.chain import Chain
from calibration.likelihood.estimate import Estimate, estimate, quadratic_pixels
from calibration.likelihood.mixed_model import Variances
from calibration.likelihood.variance_components import MIN_PIXEL_VARIANCE
from calibration.observations.reprojection import PixelStatistics, pixel_statistics
from calibration.preprocessing.prepare import PreparedSession
from calibration.sentences.sentence import Sentence
from calibration.transforms import Array, transform

START_METHODS = ("kronecker", "daniilidis", "tsai", "horaud")
"""Closed forms to start from: three that solve the rotation first, one that solves both at once."""

ONE_AXIS = "one-axis"
"""Where a coordinate along the only axis of rotation is given, the closed form for such motions alone."""

MAX_VIEWS = 20
"""Most views on which the starts are compared; more do not change the optimum they lead to."""

SAME_OPTIMUM_SIGMA = 3.0
"""Two optima closer than this many standard deviations of X are one."""

MIN_LOG_LIKELIHOOD_LEAD = 4.6
"""Lead in log-likelihood from which the better of two optima is certain: a hundred times as likely."""

NO_START = ("contradictory-input", Sentence("no-start"), Sentence("check-pose-convention"))


@dataclass(frozen=True, eq=False)
class InitialGuess:
    """The best optimum of the quadratic model of the pixels.

    `other_optima`: closed forms (names) that lead to another optimum; `ambiguous`: one of those is about as likely.
    """

    chain: Chain
    variances: Variances
    other_optima: tuple[str, ...]
    ambiguous: bool = False


def find_initial_guess(prepared: PreparedSession) -> InitialGuess:
    """The most likely of the optima that the closed forms lead to. Raises UndeterminedError `contradictory-input`."""
    few = prepared.take(np.unique(np.linspace(0, len(prepared.seen) - 1, MAX_VIEWS).astype(np.intp)))
    statistics = pixel_statistics(few.seen, few.camera, few.camera_T_target)
    pixels = quadratic_pixels(statistics, few.camera_T_target)
    found: dict[str, Estimate] = {}
    if prepared.given is None:
        starts = {name: CLOSED_FORMS[name](few.anchor_T_mount, few.camera_T_target) for name in START_METHODS}
    else:
        starts = {ONE_AXIS: one_axis(few.anchor_T_mount, few.camera_T_target, prepared.given.axis_mount)}
    for name, mount_T_camera in starts.items():
        chain = chain_from_mount(few, mount_T_camera)
        if not np.all(np.isfinite(chain.mount_T_camera)):
            continue
        if found:
            # With the noise levels fixed, a few steps show whether it leads to the same optimum.
            first = next(iter(found.values()))
            there = estimate(pixels, chain, first.variances, fixed_noise=True)
            if there.converged and _distance_sigma(first, there) < SAME_OPTIMUM_SIGMA:
                found[name] = first
                continue
        found[name] = estimate(pixels, chain, initial_variances(statistics, chain))
    if not found:
        raise UndeterminedError(*NO_START)
    scatter = {name: robot_scatter(best.chain) for name, best in found.items()}
    likeliest = min(scatter, key=lambda name: scatter[name])
    best = found[likeliest]
    elsewhere = tuple(name for name, other in found.items() if _distance_sigma(best, other) > SAME_OPTIMUM_SIGMA)
    # Two levels of 3 n residuals each: their log-likelihood is -3/2 n times the logarithms of their squares.
    behind = [1.5 * len(few.seen) * (scatter[name] - scatter[likeliest]) for name in elsewhere]
    chain = chain_from_mount(prepared, best.chain.mount_T_camera)
    return InitialGuess(chain, best.variances, elsewhere, min(behind, default=np.inf) < MIN_LOG_LIKELIHOOD_LEAD)


def chain_from_mount(prepared: PreparedSession, mount_T_camera: Array) -> Chain:
    """The chain of an X (4, 4): the target's mean pose over the views, and the corrections that explain the rest."""
    seen = prepared.anchor_T_mount @ mount_T_camera @ prepared.camera_T_target
    anchor_T_target = transform(as_rotation(seen[:, :3, :3].mean(axis=0)), seen[:, :3, 3].mean(axis=0))
    base_T_flange = prepared.seen.base_T_flange
    empty = np.zeros((len(base_T_flange), 6))
    chain = Chain(prepared.setup, base_T_flange, mount_T_camera, anchor_T_target, empty, prepared.given)
    return chain.with_corrections_from(prepared.camera_T_target)


def initial_variances(statistics: PixelStatistics, chain: Chain) -> Variances:
    """Noise levels from the pixel residuals of each view's own pose (`statistics`) and from the chain's corrections."""
    redundancy = max(float(statistics.count.sum()) - 6 * len(statistics.count), 1.0)
    pixel = max(float(statistics.square.sum()) / redundancy, MIN_PIXEL_VARIANCE)
    rotation, translation = np.median(chain.corrections[:, :3] ** 2), np.median(chain.corrections[:, 3:] ** 2)
    return Variances(pixel, 2.2 * float(rotation), 2.2 * float(translation))  # median of chi² with one degree: 0.455


def robot_scatter(chain: Chain) -> float:
    """Logarithm of the product of the corrections' two variances; the likelihood falls with it."""
    rotation, translation = np.mean(chain.corrections[:, :3] ** 2), np.mean(chain.corrections[:, 3:] ** 2)
    return float(np.log(rotation + 1e-14) + np.log(translation + 1e-8))


def _distance_sigma(best: Estimate, other: Estimate) -> float:
    """Distance of another optimum from the best, in the standard deviations of X at the best."""
    step = np.linalg.inv(best.chain.mount_T_camera) @ other.chain.mount_T_camera
    vector = np.concatenate([(step - step.T)[[2, 0, 1], [1, 2, 0]] / 2, step[:3, 3]])
    information = np.linalg.pinv(best.step.covariance[:6, :6])
    return float(np.sqrt(max(vector @ information @ vector, 0.0) / 6))
