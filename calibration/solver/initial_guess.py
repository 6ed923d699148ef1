"""Where maximum likelihood starts: several closed forms, which should all lead to the same place."""

from dataclasses import dataclass

import numpy as np

from calibration.closed_forms.kronecker import as_rotation
from calibration.closed_forms.registry import CLOSED_FORMS
from calibration.errors import UndeterminedError
from calibration.likelihood.chain import Chain
from calibration.likelihood.estimate import Estimate, estimate, frozen
from calibration.likelihood.mixed_model import Variances
from calibration.likelihood.variance_components import SMALLEST_PIXEL_VARIANCE
from calibration.observations.reprojection import PixelStatistics, pixel_statistics
from calibration.preprocessing.prepare import Prepared
from calibration.transforms import Array, transform

STARTS = ("kronecker", "daniilidis", "tsai", "horaud")
"""Rotation first by four different means, one of them with translation at once."""

MOST_VIEWS = 20
"""The starts are compared on this many views: the basin they lie in does not depend on more."""

SAME_OPTIMUM = 3.0
"""Two optima closer than this many deviations are one."""

DECISIVE = 4.6
"""Log-likelihood by which the better of two optima is believed: a hundred times as likely."""

NO_START = (
    "contradictory-input",
    "no closed form finds an X from the robot's poses and the images",
    "check the poses' units, their convention and their order",
)


@dataclass(frozen=True, eq=False)
class Start:
    """The best optimum over the pixels' quadratic, and which closed forms (names) ended elsewhere.

    `as_likely`: another optimum explains the views about as well, so that nobody knows which is right.
    """

    chain: Chain
    variances: Variances
    elsewhere: tuple[str, ...]
    as_likely: bool = False


def best_start(prepared: Prepared) -> Start:
    """The likeliest of the optima that the closed forms lead to."""
    few = prepared.take(np.unique(np.linspace(0, len(prepared.seen) - 1, MOST_VIEWS).astype(np.intp)))
    statistics = pixel_statistics(few.seen, few.camera, few.camera_T_target)
    pixels = frozen(statistics, few.camera_T_target)
    found: dict[str, Estimate] = {}
    for name in STARTS:
        chain = closed_form_chain(few, CLOSED_FORMS[name](few.anchor_T_mount, few.camera_T_target))
        if not np.all(np.isfinite(chain.mount_T_camera)):
            continue
        if found:
            # With the levels known, whether it leads to the same place takes a few steps only.
            first = next(iter(found.values()))
            there = estimate(pixels, few.camera, chain, first.variances, levels_known=True)
            if there.converged and _apart(first, there) < SAME_OPTIMUM:
                found[name] = first
                continue
        found[name] = estimate(pixels, few.camera, chain, first_variances(statistics, chain))
    if not found:
        raise UndeterminedError(*NO_START)
    scatter = {name: robot_scatter(best.chain) for name, best in found.items()}
    likeliest = min(scatter, key=lambda name: scatter[name])
    best = found[likeliest]
    elsewhere = tuple(name for name, other in found.items() if _apart(best, other) > SAME_OPTIMUM)
    # Two levels of 3 n residuals each: their log-likelihood is -3/2 n times the logarithms of their squares.
    behind = [1.5 * len(few.seen) * (scatter[name] - scatter[likeliest]) for name in elsewhere]
    chain = closed_form_chain(prepared, best.chain.mount_T_camera)
    return Start(chain, best.variances, elsewhere, min(behind, default=np.inf) < DECISIVE)


def closed_form_chain(prepared: Prepared, mount_T_camera: Array) -> Chain:
    """The target's pose as the views have it in the mean, and the corrections that explain what remains."""
    seen = prepared.anchor_T_mount @ mount_T_camera @ prepared.camera_T_target
    anchor_T_target = transform(as_rotation(seen[:, :3, :3].mean(axis=0)), seen[:, :3, 3].mean(axis=0))
    base_T_flange = prepared.seen.base_T_flange
    empty = np.zeros((len(base_T_flange), 6))
    chain = Chain(prepared.setup, base_T_flange, mount_T_camera, anchor_T_target, empty)
    return chain.with_corrections_from(prepared.camera_T_target)


def first_variances(statistics: PixelStatistics, chain: Chain) -> Variances:
    """Noise levels from what each view's own pose (its pixels' `statistics`) and the chain's corrections leave."""
    redundancy = max(float(statistics.count.sum()) - 6 * len(statistics.count), 1.0)
    pixel = max(float(statistics.square.sum()) / redundancy, SMALLEST_PIXEL_VARIANCE)
    rotation, translation = np.median(chain.corrections[:, :3] ** 2), np.median(chain.corrections[:, 3:] ** 2)
    return Variances(pixel, 2.2 * float(rotation), 2.2 * float(translation))  # median of chi² with one degree: 0.455


def robot_scatter(chain: Chain) -> float:
    """The corrections' volume: the product of their two levels, which the likelihood falls with."""
    rotation, translation = np.mean(chain.corrections[:, :3] ** 2), np.mean(chain.corrections[:, 3:] ** 2)
    return float(np.log(rotation + 1e-14) + np.log(translation + 1e-8))


def _apart(best: Estimate, other: Estimate) -> float:
    """Distance of another optimum from the best in the best's deviations of X."""
    step = np.linalg.inv(best.chain.mount_T_camera) @ other.chain.mount_T_camera
    vector = np.concatenate([(step - step.T)[[2, 0, 1], [1, 2, 0]] / 2, step[:3, 3]])
    information = np.linalg.pinv(best.step.covariance[:6, :6])
    return float(np.sqrt(max(vector @ information @ vector, 0.0) / 6))
