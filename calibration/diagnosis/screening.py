"""Screening: whether a session needs a diagnosis, by score tests of every cause at one fit.

A score test gives the decrease of a quadratic when an unknown is freed, without freeing it (C. R. Rao, Proc. Cambridge
Phil. Soc. 44, 1948). With D residuals whose noise is estimated from themselves, a decrease of s is a gain of
-D/2 log(1 - s/D) in log-likelihood.
"""

from collections.abc import Iterator

import numpy as np

from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.fit import Fit
from calibration.diagnosis.hypothesis import few_views_factor, price_of
from calibration.diagnosis.view_hypotheses import MIN_VIEWS_PER_SIDE
from calibration.kinematics.robot_accuracy import MAX_USUAL_NOISE
from calibration.linear_algebra import inverse_or_pseudo_inverse, scaled_inverse, scaled_solve

FEW_VIEWS = 20
"""Up to so many views are always diagnosed: that takes less than 0.1 s, and the estimated gains are poor."""

MIN_GAIN_ONE_VIEW, MIN_GAIN_CHANGE, MIN_GAIN_SIZE = 3.0, -3.0, 0.0
"""Estimated gains from which a session is diagnosed. The gain of a change is underestimated by up to a factor of four:
the score test assumes that half of the residuals belong to the noise level that absorbs the fault, and fewer do where
the pixels' noise dominates."""


def needs_diagnosis(evidence: Evidence, fitted: Fit) -> bool:
    """Whether a diagnosis might find a fault of these views."""
    if len(evidence) <= FEW_VIEWS or is_unusual(fitted):
        return True
    return any(gain > limit for gain, limit in _gains(evidence, fitted))


def is_unusual(fitted: Fit) -> bool:
    """Whether robot and images disagree by more than is usual."""
    return not fitted.robot_noise.is_within(MAX_USUAL_NOISE)


def _gains(evidence: Evidence, fitted: Fit) -> Iterator[tuple[float, float]]:
    """The estimated gain of each kind of fault, and its limit."""
    n = len(evidence)
    weights = inverse_or_pseudo_inverse(fitted.covariance)
    by_shared, residuals = fitted.by_shared, fitted.residuals[..., None]
    weighted = weights @ by_shared
    normal = np.swapaxes(by_shared, 1, 2) @ weighted
    shared = scaled_inverse(normal.sum(axis=0))

    # One view is off: its squared distance from the others.
    outside = fitted.covariance - by_shared @ shared @ np.swapaxes(by_shared, 1, 2)
    ridge = 1e-9 * np.einsum("nii->ni", fitted.covariance)[:, :, None] * np.eye(6)
    distances = np.einsum("nik,nij,njl->nkl", residuals, inverse_or_pseudo_inverse(outside + ridge), residuals)[:, 0, 0]
    yield _gain(float(distances.max()), n, 1, 7 * n), MIN_GAIN_ONE_VIEW

    # X or the target's pose changes at some view.
    gradients = (np.swapaxes(weighted, 1, 2) @ residuals)[..., 0]
    for block in (slice(0, 6), slice(6, 12)):
        score = np.cumsum(gradients[::-1], axis=0)[::-1][MIN_VIEWS_PER_SIDE : n - MIN_VIEWS_PER_SIDE + 1, block]
        after = np.cumsum(normal[::-1], axis=0)[::-1][MIN_VIEWS_PER_SIDE : n - MIN_VIEWS_PER_SIDE + 1]
        information = after[:, block, block] - after[:, block] @ shared @ after[:, :, block]
        falls = np.sum(score * scaled_solve(information, score[..., None], ridge=1e-9)[..., 0], axis=-1)
        yield _gain(float(falls.max(initial=0.0)), n, 6, 2 * n), MIN_GAIN_CHANGE

    # The target's size.
    slope = np.zeros((n, 6, 1))
    slope[:, 3:, 0] = -evidence.camera_T_target[:, :3, 3]
    cross = (np.swapaxes(slope, 1, 2) @ weighted).sum(axis=0)
    fisher = float((np.swapaxes(slope, 1, 2) @ weights @ slope).sum()) - float((cross @ shared @ cross.T).sum())
    gradient = float((np.swapaxes(slope, 1, 2) @ weights @ residuals).sum())
    yield _gain(gradient**2 / max(fisher, 1e-300), n, 1, 1), MIN_GAIN_SIZE


def _gain(fall: float, n: int, unknowns: int, alternatives: int) -> float:
    # One of the two noise levels absorbs the fault: half of the residuals.
    redundancy = max(3 * n - 6, 3)
    raw = -0.5 * redundancy * np.log1p(-min(fall / redundancy, 1 - 1e-9))
    return float(few_views_factor(n, unknowns) * raw - price_of(n, unknowns, alternatives))
