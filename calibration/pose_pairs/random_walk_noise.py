"""The most likely X when the camera's errors add up from view to view, as in odometry.

In the target's frame such an error is a sum of steps, so that differences of successive views contain one step each,
and the target's pose drops out. Independent errors of a view are part of two differences: the covariance is block
tridiagonal, and is treated as a dense matrix (for at most a few hundred views).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from calibration.closed_forms.kronecker import as_rotation
from calibration.linear_algebra import covariance_of
from calibration.observations.pose_model import clip_step
from calibration.pose_pairs.independent_noise import PoseFit
from calibration.pose_pairs.noise_models import RANDOM_WALK
from calibration.pose_pairs.reml_optimizer import Moments, State, initial_variances, maximise, restriction_term
from calibration.pose_pairs.residuals import PosePairs, ScaledChain, floor_variances, linearise
from calibration.transforms import Array, transform

MIN_VIEWS = 8
MIN_EVIDENCE = 3.0
"""Logarithm of the odds from which a walk is believed: 20 to 1, "strong" by R. Kass & A. Raftery, JASA 90, 1995.

Of ten views with independent errors a walk is the likelier model by chance in one session of twenty, and its X then too
sure: its levels are not averaged.
"""


@dataclass(frozen=True, eq=False)
class _Blocks:
    """A symmetric matrix of 6×6 blocks: `diagonal` (m, 6, 6), and `beside` (m - 1, 6, 6) right of it."""

    diagonal: Array
    beside: Array

    def sparse(self) -> sparse.bsr_matrix:
        m = len(self.diagonal)
        below = np.concatenate([np.zeros((1, 6, 6)), np.swapaxes(self.beside, 1, 2)])
        above = np.concatenate([self.beside, np.zeros((1, 6, 6))])
        blocks = np.stack([below, self.diagonal, above], axis=1).reshape(-1, 6, 6)
        columns = np.clip(np.arange(m)[:, None] + [-1, 0, 1], 0, m - 1).reshape(-1)
        return sparse.bsr_matrix((blocks, columns, np.arange(0, 3 * m + 1, 3)), shape=(6 * m, 6 * m))


@dataclass(frozen=True, eq=False)
class _Differences:
    """Residuals (m, 6), derivatives (m, 6, p), and the covariance by one unit of variance of every source."""

    residuals: Array
    by_shared: Array
    directions: dict[str, Array]
    shares: dict[str, _Blocks]


def with_random_walk(pairs: PosePairs, independent: PoseFit) -> PoseFit:
    """The fit with a random walk where MIN_VIEWS views or more are strong evidence of one; else `independent`."""
    if len(pairs) < MIN_VIEWS or pairs.covariance is not None:
        return independent
    drifting = fit_random_walk(pairs, replace(independent.chain, depth=1.0))
    gain = drifting.evidence(len(pairs)) - independent.evidence(len(pairs))
    return drifting if gain > MIN_EVIDENCE else independent


def fit_random_walk(pairs: PosePairs, start: ScaledChain) -> PoseFit:
    """The fit with independent errors of robot and camera and a random walk of the camera; Y from the first view."""
    chosen = np.r_[0:6, 12:13] if pairs.length_sigmas else np.r_[0:6]
    steps = _differences(pairs, start, chosen)
    first = initial_variances(steps.residuals, list(steps.directions.values()))
    best = maximise(lambda chain, variances: _state(pairs, chain, variances, chosen), start, first)
    named = dict(zip(steps.shares, best.variances.tolist(), strict=True))
    covariance = np.zeros((len(chosen) + 6, len(chosen) + 6))  # differences do not determine the target's pose
    covariance[np.ix_(chosen, chosen)] = best.covariance
    return PoseFit(best.chain, covariance, named, best.log_likelihood, np.inf, RANDOM_WALK)


def _state(pairs: PosePairs, chain: ScaledChain, variances: Array, chosen: NDArray[np.intp]) -> State:
    steps = _differences(pairs, chain, chosen)
    residuals, by_shared = steps.residuals.reshape(-1), steps.by_shared.reshape(-1, len(chosen))
    shares = [share.sparse() for share in steps.shares.values()]
    total = sum(v * share for v, share in zip(variances, shares, strict=True)).toarray()
    floor = np.tile(floor_variances(chain.scale), len(steps.residuals))
    total[np.diag_indices_from(total)] += floor
    information = np.asarray(np.linalg.inv(total), np.float64)
    weighted = information @ by_shared
    normal = by_shared.T @ weighted
    covariance = covariance_of(normal)
    step = clip_step(-covariance @ (weighted.T @ residuals))
    moments = _moments(shares, information, weighted, residuals + by_shared @ step, covariance, floor)
    square = float(np.linalg.slogdet(total)[1] + residuals @ information @ residuals)
    # The scale of the first view's lengths, of which no difference is taken.
    value = -0.5 * square - 0.5 * len(residuals) * float(np.log(2 * np.pi)) - 3 * float(np.log(chain.scale))
    return State(
        chain, variances, value + restriction_term(normal), covariance, _apply_step(pairs, chain, chosen, step), moments
    )


def _differences(pairs: PosePairs, chain: ScaledChain, chosen: NDArray[np.intp]) -> _Differences:
    at = linearise(pairs, chain)
    # In the target's frame a change of the target's pose changes all residuals alike.
    by_target = at.by_shared[:, :, 6:12]
    to_target = np.asarray(np.linalg.inv(by_target), np.float64)
    back = by_target[1:]
    residuals = back @ _steps(to_target @ at.residuals[:, :, None])
    by_shared = back @ _steps(to_target @ at.by_shared[:, :, chosen])
    alone = {
        "robot rotation": at.by_flange[:, :, :3],
        "robot translation": at.by_flange[:, :, 3:],
        "camera rotation": at.by_camera[:, :, :3],
        "camera lateral": at.by_camera[:, :, 3:],
    }
    walk = {"drift rotation": at.by_camera[1:, :, :3], "drift translation": at.by_camera[1:, :, 3:]}
    shares = {name: _of_neighbours(back, to_target @ direction) for name, direction in alone.items()}
    for name, steps in walk.items():
        shares[name] = _Blocks(steps @ np.swapaxes(steps, 1, 2), np.zeros((len(steps) - 1, 6, 6)))
    return _Differences(residuals[..., 0], by_shared, alone | walk, shares)


def _steps(values: Array) -> Array:
    return values[1:] - values[:-1]


def _of_neighbours(back: Array, directions: Array) -> _Blocks:
    later, earlier = back @ directions[1:], back @ directions[:-1]
    own = later @ np.swapaxes(later, 1, 2) + earlier @ np.swapaxes(earlier, 1, 2)
    return _Blocks(own, -later[:-1] @ np.swapaxes(earlier[1:], 1, 2))


def _apply_step(pairs: PosePairs, chain: ScaledChain, chosen: NDArray[np.intp], step: Array) -> ScaledChain:
    """The chain with X and the scale changed by a step, and the target's pose from the first view."""
    whole = np.zeros(13 if pairs.length_sigmas else 12)
    whole[chosen] = step
    moved = chain.apply_step(whole)
    seen = pairs.camera_T_target[0].copy()
    seen[:3, 3] /= moved.scale
    first = pairs.anchor_T_mount()[0] @ moved.mount_T_camera @ seen
    return ScaledChain(moved.mount_T_camera, transform(as_rotation(first[:3, :3]), first[:3, 3]), moved.scale)


def _moments(
    shares: list[sparse.bsr_matrix], information: Array, weighted: Array, left: Array, covariance: Array, floor: Array
) -> Moments:
    """As in `calibration.pose_pairs.independent_noise`, for a covariance that is not block diagonal."""
    through = [np.asarray(share @ information) for share in shares]
    rows = np.array([t.reshape(-1) for t in through])
    pulled = information @ left
    return Moments(
        squares=np.array([pulled @ (share @ pulled) for share in shares]),
        spent=np.array([np.sum(covariance * (weighted.T @ (share @ weighted))) for share in shares]),
        floor=np.array([np.sum(information * t.T, axis=1) @ floor for t in through]),
        trace=np.array([np.trace(t) for t in through]),
        fisher=rows @ np.array([t.T.reshape(-1) for t in through]).T,
    )
