"""Weights of the views by their pixel noise, shrunk towards the common noise (empirical Bayes).

A view's residuals about its own pose estimate its noise from 2 m - 6 numbers. The true spread between views is
estimated from the excess of these estimates' scatter over chi-square; it decides how far each is shrunk.
Source: G. Smyth, "Linear models and empirical Bayes methods", Stat. Appl. Genet. Mol. Biol. 3(1) 2004, section 6.
"""

import numpy as np

from calibration.camera import CameraModel
from calibration.likelihood.distributions import tetragamma, trigamma
from calibration.observations.observations import Observations
from calibration.observations.reprojection import pixel_residuals
from calibration.transforms import Array

MIN_VIEWS = 6
"""Fewer views do not determine the spread between views."""

MAX_RATIO = 30.0
"""Bound of the ratio between the common variance and a view's, either way."""

BIAS_PX = 0.02
"""Standard deviation of a detector's error common to a whole view, which the scatter within a view does not show."""


def weight_by_view_noise(seen: Observations, camera: CameraModel, camera_T_target: Array) -> Observations:
    """The observations with corners weighted by their view's noise; unchanged when the views do not differ."""
    redundancy = 2.0 * np.count_nonzero(seen.weights, axis=1) - 6
    if len(seen) < MIN_VIEWS or np.any(redundancy < 2):
        return seen
    square = np.sum(seen.weights[..., None] * pixel_residuals(seen, camera, camera_T_target) ** 2, axis=(1, 2))
    if np.any(square <= 0):
        return seen
    variances = square / redundancy
    common = float(square.sum() / redundancy.sum())
    known = _prior_redundancy(np.log(variances), redundancy)
    if not np.isfinite(known):
        return seen
    drawn = BIAS_PX**2 + (redundancy * variances + known * float(np.exp(np.mean(np.log(variances))))) / (
        redundancy + known
    )
    ratio = np.clip((BIAS_PX**2 + common) / drawn, 1 / MAX_RATIO, MAX_RATIO)
    # Scaled so that the weighted residuals keep the common variance.
    ratio *= common * redundancy.sum() / float(ratio @ square)
    return seen.with_weights(seen.weights * ratio[:, None])


def _prior_redundancy(logs: Array, redundancy: Array) -> float:
    """d0 with trigamma(d0 / 2) = var(log s²) - mean trigamma(d / 2); infinite without a significant spread of views."""
    chance = trigamma(redundancy / 2)
    excess = float(np.var(logs, ddof=1) - np.mean(chance))
    # The scatter of n estimates is itself uncertain by sqrt(2 / (n - 1)).
    if excess < 3 * float(np.mean(chance)) * np.sqrt(2 / (len(logs) - 1)):
        return np.inf
    half = 0.5 + 1 / excess
    for _ in range(20):
        slope = trigamma(half)
        half += float(slope * (1 - slope / excess) / tetragamma(half))
    return 2 * half
