"""Maximises the restricted likelihood (REML) of a chain and of its noise variances.

Fisher scoring converges in a few rounds but may overshoot; a step that lowers the likelihood is replaced by the slower
MM step, which cannot (H. Zhou, L. Hu, J. Zhou & K. Lange, "MM algorithms for variance components models", J. Comput.
Graph. Stat. 28(2), 2019). Restricted likelihood: S. Searle, G. Casella & C. McCulloch, "Variance Components", 1992,
ch. 6.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from calibration.linear_algebra import unit_diagonal
from calibration.pose_pairs.residuals import ScaledChain
from calibration.transforms import Array

MAX_ROUNDS = 20
LOG_LIKELIHOOD_TOLERANCE = 1e-2
"""The iteration ends when the log-likelihood gains less."""

MIN_EIGENVALUE = 1e-9


@dataclass(frozen=True, eq=False)
class Moments:
    """Terms of the variance update, for each source (g,).

    squares : weighted squares of the residuals that are left.
    spent : the part of them absorbed by the unknowns.
    floor : the part due to the residuals' floor.
    trace : expected squares by one unit of a source alone.
    fisher : (g, g), expected squares are `fisher` @ variances.
    """

    squares: Array
    spent: Array
    floor: Array
    trace: Array
    fisher: Array

    def fisher_update(self) -> Array:
        """The non-negative variances (g,) for which squares and expected squares agree: Fisher scoring."""
        scaled, scale = unit_diagonal(self.fisher)
        values, vectors = np.linalg.eigh(scaled)
        # Sources that act alike are not separable: least squares with the root of the floored Fisher matrix.
        root = np.sqrt(np.maximum(values, MIN_EIGENVALUE))
        explained = scale * (self.squares + self.spent - self.floor)
        return np.asarray(scale * scipy.optimize.nnls(root[:, None] * vectors.T, vectors.T @ explained / root)[0])

    def mm_update(self, variances: Array) -> Array:
        """The variances (g,) after one MM step, which never lowers the likelihood."""
        expected = np.maximum(self.trace - self.spent, 1e-12 * self.trace + 1e-300)
        return np.asarray(variances * np.sqrt(np.maximum(self.squares, 0.0) / expected))


@dataclass(frozen=True, eq=False)
class State:
    """A chain, its noise and their log-likelihood; `next_chain` is one Gauss-Newton step further."""

    chain: ScaledChain
    variances: Array
    log_likelihood: float
    covariance: Array
    next_chain: ScaledChain
    moments: Moments


def maximise(state_at: Callable[[ScaledChain, Array], State], chain: ScaledChain, variances: Array) -> State:
    """The state of highest log-likelihood found from a start."""
    here = state_at(chain, variances)
    for _ in range(MAX_ROUNDS):
        there = state_at(here.next_chain, here.moments.fisher_update())
        if there.log_likelihood < here.log_likelihood:
            there = state_at(here.next_chain, here.moments.mm_update(here.variances))
        gained = there.log_likelihood - here.log_likelihood
        if gained > 0:
            here = there
        if gained < LOG_LIKELIHOOD_TOLERANCE:
            break
    return here


def initial_variances(residuals: Array, directions: list[Array]) -> Array:
    """Initial variances (g,): an equal share of the start's residuals (n, 6) for every source of a kind."""
    rotation, translation = np.median(residuals[:, :3] ** 2) + 1e-12, np.median(residuals[:, 3:] ** 2) + 1e-6
    size = np.array([np.mean(direction**2, axis=(0, 2)) for direction in directions])
    turns, shifts = size[:, :3].sum(axis=1), size[:, 3:].sum(axis=1)
    share: Array = np.minimum(
        np.where(turns > 1e-12, rotation / np.maximum(turns, 1e-12), np.inf),
        np.where(shifts > 1e-12, translation / np.maximum(shifts, 1e-12), np.inf),
    )
    return share / 2


def restriction_term(normal: Array) -> float:
    """The term of the restricted log-likelihood for unknowns with this normal matrix (p, p)."""
    return 0.5 * float(len(normal) * np.log(2 * np.pi) - np.linalg.slogdet(normal)[1])
