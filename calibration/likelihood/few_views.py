"""Very few views: the noise levels are averaged over, not estimated.

Three views leave three observations of each robot level, and an estimate from three may well be a tenth of the truth.
So X and its covariance are averaged over all levels, each as likely as the residuals make it (restricted likelihood)
times what robots are like: rotation and translation noise log-normal about a stated level. The mean squared error of
such an average is what its covariance says when the stated levels are right on average.
Source: D. Harville, "Bayesian inference for variance components using only error contrasts", Biometrika 61, 1974.
"""

from dataclasses import dataclass

import numpy as np

from calibration.likelihood.mixed_model import MixedModel, Variances, solve
from calibration.transforms import Array

MOST_VIEWS = 7
"""More views know the levels better than anybody states them."""

STATED_DEVIATIONS = np.array([np.radians(0.01), 0.1])
"""An industrial robot in its working volume: rad and mm, per axis."""

STATED_FACTOR = 4.0
"""One deviation of what robots are like: a quarter to four times the stated level."""

STEPS = np.linspace(-2.5, 2.5, 11)


@dataclass(frozen=True, eq=False)
class Averaged:
    """Mean of the shared step (p,), its covariance (p, p), and the root mean square levels."""

    b: Array
    covariance: Array
    variances: Variances


def averaged(model: MixedModel, pixel: float) -> Averaged:
    """Over the robot's two levels; the pixels are many, and their level is known."""
    levels = (STATED_DEVIATIONS * STATED_FACTOR ** STEPS[:, None]) ** 2  # (k, 2)
    grid = [(Variances(pixel, levels[i, 0], levels[j, 1]), -(STEPS[i] ** 2 + STEPS[j] ** 2) / 2) for i, j in _pairs()]
    found = [(*_likelihood(model, variances, prior), variances) for variances, prior in grid]
    weights = np.exp(np.array([log for log, *_ in found]) - max(log for log, *_ in found))
    weights /= weights.sum()
    steps, covariances = np.array([b for _, b, _, _ in found]), np.array([c for _, _, c, _ in found])
    mean = weights @ steps
    off = steps - mean
    covariance = np.einsum("k,kij->ij", weights, covariances) + (weights[:, None] * off).T @ off
    rotation, translation = (
        float(weights @ np.array([getattr(v, name) for *_, v in found])) for name in ("rotation", "translation")
    )
    return Averaged(mean, covariance, Variances(pixel, rotation, translation))


def _pairs() -> list[tuple[int, int]]:
    return [(i, j) for i in range(len(STEPS)) for j in range(len(STEPS))]


def _likelihood(model: MixedModel, variances: Variances, prior: float) -> tuple[float, Array, Array]:
    """Log of the restricted likelihood times the prior, up to a constant; b and its covariance there."""
    step = solve(model, variances)
    deviation = variances.deviations()
    _, log_V = np.linalg.slogdet(np.eye(6) + deviation[:, None] * model.UU * deviation / variances.pixel)
    scale = np.sqrt(np.maximum(np.diagonal(step.covariance), 1e-300))
    _, log_S = np.linalg.slogdet(step.covariance / scale[:, None] / scale)
    log_S += 2 * np.sum(np.log(scale))
    KUy = (step.K @ model.Uy[..., None])[..., 0]
    quadratic = (model.yy.sum() - np.sum(KUy * model.Uy)) / variances.pixel + step.b @ step.view_gradient.sum(axis=0)
    return prior - 0.5 * float(log_V.sum() - log_S + quadratic), step.b, step.covariance
