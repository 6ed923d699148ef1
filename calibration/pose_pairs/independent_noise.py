"""The likeliest X where every view errs for itself.

Heavy tails are a multivariate t with its weights (t + 6) / (t + d²): K. Lange, R. Little & J. Taylor, "Robust
statistical modeling using the t distribution", JASA 84, 1989.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln
from scipy.stats import f as f_distribution

from calibration.linear_algebra import covariance_of
from calibration.observations.pose_model import clip_step
from calibration.pose_pairs.noise_models import CAMERAS, Sources, robot
from calibration.pose_pairs.reml_optimizer import (
    Moments,
    State,
    climbed,
    first_variances,
    floor_variances,
    spent_on,
)
from calibration.pose_pairs.residuals import Chain, Linearised, PosePairs, linearise
from calibration.transforms import Array

OUTLYING = 1e-4
"""One honest view in so many is called an outlier."""


@dataclass(frozen=True, eq=False)
class PoseFit:
    """The likeliest chain under a model of the noise, and how likely (restricted) that makes the poses.

    `covariance` (p, p) of [X 6, Y 6, log scale]; `variances` by source, rad² or mm²; `tails`: degrees of freedom.
    """

    chain: Chain
    covariance: Array
    variances: dict[str, float]
    log_likelihood: float
    tails: float
    camera: str

    def evidence(self, views: int) -> float:
        """For choosing between models: every level and the tails cost what G. Schwarz, Ann. Stat. 6(2), 1978, says."""
        levels = len(self.variances) + bool(np.isfinite(self.tails))
        return self.log_likelihood - 0.5 * levels * float(np.log(6 * views))


def fit_white(pairs: PosePairs, start: Chain, camera: str, tails: float) -> PoseFit:
    """`camera` is one of `CAMERAS`; `tails` degrees of freedom of the views' errors, infinite for normal ones."""
    sources = _sources(linearise(pairs, start), camera)
    first = first_variances(linearise(pairs, start).residuals, list(sources.values()))
    best = climbed(lambda chain, variances: _state(pairs, chain, variances, camera, tails), start, first)
    named = dict(zip(sources, best.variances.tolist(), strict=True))
    return PoseFit(best.chain, best.covariance, named, best.log_likelihood, tails, camera)


def distances_of(pairs: PosePairs, fitted: PoseFit) -> Array:
    """Squared Mahalanobis distance (n,) of views that need not have taken part in the fit."""
    at = linearise(pairs, fitted.chain)
    sources = _sources(at, fitted.camera)
    variances = np.array([fitted.variances[name] for name in sources])
    return _squared(at.residuals, _information(list(sources.values()), variances, at.scale))


def outlying(tails: float, views: int) -> float:
    """The squared distance that one honest view in ten thousand exceeds; few `views` know the levels poorly."""
    redundancy = max(3 * views - 6, 3)
    return 6 * float(f_distribution.isf(OUTLYING, 6, min(tails, redundancy)))


def _sources(at: Linearised, camera: str) -> Sources:
    model: Callable[[Linearised], Sources] = CAMERAS[camera]
    return robot(at) | model(at)


def _state(pairs: PosePairs, chain: Chain, variances: Array, camera: str, tails: float) -> State:
    at = linearise(pairs, chain)
    directions = list(_sources(at, camera).values())
    information = _information(directions, variances, at.scale)
    distances = _squared(at.residuals, information)
    weights = (tails + 6) / (tails + distances) if np.isfinite(tails) else np.ones(len(pairs))
    weighted = ((information * weights[:, None, None]) @ at.by_shared).reshape(-1, at.by_shared.shape[2])
    normal = weighted.T @ at.by_shared.reshape(weighted.shape)
    covariance = covariance_of(normal)
    step = clip_step(-covariance @ (weighted.T @ at.residuals.reshape(-1)))
    left = at.residuals + at.by_shared @ step
    moments = _moments(directions, information, weights, left, at, covariance)
    value = _log_likelihood(information, distances, tails) + spent_on(normal)
    return State(chain, variances, value, covariance, chain.moved(step), moments)


def _information(directions: list[Array], variances: Array, scale: float) -> Array:
    spread = np.concatenate([d * np.sqrt(v) for d, v in zip(directions, variances, strict=True)], axis=2)
    return np.asarray(np.linalg.inv(spread @ np.swapaxes(spread, 1, 2) + np.diag(floor_variances(scale))), np.float64)


def _squared(residuals: Array, information: Array) -> Array:
    distances: Array = np.sum(residuals * (information @ residuals[..., None])[..., 0], axis=1)
    return distances


def _log_likelihood(information: Array, distances: Array, tails: float) -> float:
    determinants = 0.5 * float(np.linalg.slogdet(information)[1].sum())
    if not np.isfinite(tails):
        return determinants - 0.5 * float(distances.sum()) - 3 * len(distances) * float(np.log(2 * np.pi))
    constant = gammaln((tails + 6) / 2) - gammaln(tails / 2) - 3 * np.log(tails * np.pi)
    return float(determinants + len(distances) * constant - (tails + 6) / 2 * np.log1p(distances / tails).sum())


def _moments(
    directions: list[Array], information: Array, weights: Array, left: Array, at: Linearised, covariance: Array
) -> Moments:
    starts = np.cumsum([0, *(direction.shape[2] for direction in directions)])[:-1]
    spread = np.concatenate(directions, axis=2)  # (n, 6, K), every source's columns side by side
    across = information @ spread
    seen = (np.swapaxes(across, 1, 2) @ left[..., None])[..., 0]
    used = np.swapaxes(across, 1, 2) @ at.by_shared
    between = np.sum((np.swapaxes(spread, 1, 2) @ across) ** 2, axis=0)  # (K, K)
    return Moments(
        squares=np.add.reduceat((weights[:, None] * seen**2).sum(axis=0), starts),
        spent=np.add.reduceat(np.sum(weights[:, None, None] * (used @ covariance) * used, axis=(0, 2)), starts),
        floor=np.add.reduceat(np.sum(across**2 * floor_variances(at.scale)[:, None], axis=(0, 1)), starts),
        trace=np.add.reduceat(np.sum(spread * across, axis=(0, 1)), starts),
        fisher=np.add.reduceat(np.add.reduceat(between, starts, axis=0), starts, axis=1),
    )
