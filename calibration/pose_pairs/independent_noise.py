"""The most likely X when the errors of the views are independent.

Heavy tails are a multivariate t with its weights (t + 6) / (t + d²): K. Lange, R. Little & J. Taylor, "Robust
statistical modeling using the t distribution", JASA 84, 1989.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import fdtri, gammaln

from calibration.linear_algebra import covariance_of
from calibration.observations.pose_model import clip_step
from calibration.pose_pairs.noise_models import sources_of
from calibration.pose_pairs.reml_optimizer import Moments, State, initial_variances, maximise, restriction_term
from calibration.pose_pairs.residuals import LinearisedPairs, PosePairs, ScaledChain, linearise
from calibration.solution import ArmScale
from calibration.transforms import Array

OUTLIER_PROBABILITY = 1e-4
"""Probability that a correct view is called an outlier."""


@dataclass(frozen=True, eq=False)
class PoseFit:
    """The most likely chain under a model of the noise, with its restricted log-likelihood.

    covariance : (p, p) of [X 6, Y 6, log scale, log depth].
    variances : by source, rad² or mm².
    tail_dof : degrees of freedom of the t distribution of the errors, infinite for normal ones.
    camera : the kind of camera noise, a key of CAMERAS, GIVEN or RANDOM_WALK.
    arm_scale : lengths by the arm over the camera's, None until they are compared.
    off : whether the scale, and the depth besides it, is significantly off.
    """

    chain: ScaledChain
    covariance: Array
    variances: dict[str, float]
    log_likelihood: float
    tail_dof: float
    camera: str
    arm_scale: ArmScale | None = None
    off: tuple[bool, ...] = (False,)

    def evidence(self, views: int) -> float:
        """Score for choosing between models: log-likelihood less the penalty of G. Schwarz, Ann. Stat. 6(2), 1978."""
        levels = len(self.variances) + bool(np.isfinite(self.tail_dof))
        return self.log_likelihood - 0.5 * levels * float(np.log(6 * views))


def fit_independent_noise(pairs: PosePairs, start: ScaledChain, camera: str, tails: float) -> PoseFit:
    """The most likely fit from a start; `camera` as in PoseFit, `tails` degrees of freedom of the views' errors."""
    sources = sources_of(linearise(pairs, start), camera)
    first = initial_variances(linearise(pairs, start).residuals, list(sources.values()))
    best = maximise(lambda chain, variances: _state(pairs, chain, variances, camera, tails), start, first)
    named = dict(zip(sources, best.variances.tolist(), strict=True))
    return PoseFit(best.chain, best.covariance, named, best.log_likelihood, tails, camera)


def distances_of(pairs: PosePairs, fitted: PoseFit) -> Array:
    """Squared Mahalanobis distance (n,) of views, whether or not they are part of the fit."""
    at = linearise(pairs, fitted.chain)
    return _squared_distances(at.residuals, information_of(at, fitted))


def information_of(at: LinearisedPairs, fitted: PoseFit) -> Array:
    """Inverse covariance (n, 6, 6) of the residuals under a fit, whether or not the views are part of it."""
    sources = sources_of(at, fitted.camera)
    return _information(list(sources.values()), np.array([fitted.variances[name] for name in sources]), at.floor)


def outlier_limit(tails: float, views: int) -> float:
    """The squared distance that a correct view exceeds with OUTLIER_PROBABILITY; larger for few `views`."""
    redundancy = max(3 * views - 6, 3)
    return 6 * float(fdtri(6, min(tails, redundancy), 1 - OUTLIER_PROBABILITY))


def _state(pairs: PosePairs, chain: ScaledChain, variances: Array, camera: str, tails: float) -> State:
    at = linearise(pairs, chain)
    directions = list(sources_of(at, camera).values())
    information = _information(directions, variances, at.floor)
    distances = _squared_distances(at.residuals, information)
    weights = (tails + 6) / (tails + distances) if np.isfinite(tails) else np.ones(len(pairs))
    weighted = ((information * weights[:, None, None]) @ at.by_shared).reshape(-1, at.by_shared.shape[2])
    normal = weighted.T @ at.by_shared.reshape(weighted.shape) + at.known[:, :-1]
    covariance = covariance_of(normal)
    step = clip_step(-covariance @ (weighted.T @ at.residuals.reshape(-1) + at.known[:, -1]))
    left = at.residuals + at.by_shared @ step
    moments = _moments(directions, information, weights, left, at, covariance)
    value = _log_likelihood(information, distances, tails) + restriction_term(normal)
    return State(chain, variances, value, covariance, chain.apply_step(step), moments)


def _information(directions: list[Array], variances: Array, floor: Array) -> Array:
    spread = np.concatenate([d * np.sqrt(v) for d, v in zip(directions, variances, strict=True)], axis=2)
    return np.asarray(np.linalg.inv(spread @ np.swapaxes(spread, 1, 2) + floor), np.float64)


def _squared_distances(residuals: Array, information: Array) -> Array:
    distances: Array = np.sum(residuals * (information @ residuals[..., None])[..., 0], axis=1)
    return distances


def _log_likelihood(information: Array, distances: Array, tails: float) -> float:
    determinants = 0.5 * float(np.linalg.slogdet(information)[1].sum())
    if not np.isfinite(tails):
        return determinants - 0.5 * float(distances.sum()) - 3 * len(distances) * float(np.log(2 * np.pi))
    constant = gammaln((tails + 6) / 2) - gammaln(tails / 2) - 3 * np.log(tails * np.pi)
    return float(determinants + len(distances) * constant - (tails + 6) / 2 * np.log1p(distances / tails).sum())


def _moments(
    directions: list[Array], information: Array, weights: Array, left: Array, at: LinearisedPairs, covariance: Array
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
        floor=np.add.reduceat(np.sum(across * (at.floor @ across), axis=(0, 1)), starts),
        trace=np.add.reduceat(np.sum(spread * across, axis=(0, 1)), starts),
        fisher=np.add.reduceat(np.add.reduceat(between, starts, axis=0), starts, axis=1),
    )
