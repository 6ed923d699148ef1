"""Up the restricted likelihood of a chain and of the variances of its noise.

Fisher scoring settles in a few rounds, and overshoots from afar: what it makes worse is repeated with the slower
multiplicative rule that cannot (H. Zhou, L. Hu, J. Zhou & K. Lange, "MM algorithms for variance components models",
J. Comput. Graph. Stat. 28(2), 2019). Restricted likelihood: S. Searle, G. Casella & C. McCulloch, "Variance
Components", 1992, ch. 6.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from calibration.linear_algebra import unit_diagonal
from calibration.pose_pairs.residuals import Chain
from calibration.transforms import Array

ROUNDS = 20
SETTLED = 1e-2
"""A change of the log-likelihood that decides nothing."""

FLOOR = np.repeat([1e-6, 1e-3], 3) ** 2
"""rad², mm²: below what any controller or camera prints."""

SMALLEST_EIGENVALUE = 1e-9


def floor_variances(scale: float) -> Array:
    """Variances (6,) of a residual that are always there; lengths in the camera's own unit."""
    return np.asarray(FLOOR * np.repeat([1.0, scale**2], 3), np.float64)


@dataclass(frozen=True, eq=False)
class Moments:
    """Per source (g,): the weighted `squares` left, what was `spent` on the unknowns, and what is expected.

    Expected is `fisher` @ variances, and of one unit of a source alone `trace`, all without the floor.
    """

    squares: Array
    spent: Array
    floor: Array
    trace: Array
    fisher: Array

    def scored(self) -> Array:
        """The variances, none below zero, with which the squares are what one expects."""
        scaled, scale = unit_diagonal(self.fisher)
        values, vectors = np.linalg.eigh(scaled)
        # Sources that act alike are told apart by nothing: least squares with the square root of what is left of it.
        root = np.sqrt(np.maximum(values, SMALLEST_EIGENVALUE))
        explained = scale * (self.squares + self.spent - self.floor)
        return np.asarray(scale * nnls(root[:, None] * vectors.T, vectors.T @ explained / root)[0])

    def surely(self, variances: Array) -> Array:
        """Variances nearer to the likeliest than these."""
        expected = np.maximum(self.trace - self.spent, 1e-12 * self.trace + 1e-300)
        return np.asarray(variances * np.sqrt(np.maximum(self.squares, 0.0) / expected))


@dataclass(frozen=True, eq=False)
class State:
    """A chain, its noise and their log-likelihood; `better` is the chain one Gauss-Newton step on."""

    chain: Chain
    variances: Array
    log_likelihood: float
    covariance: Array
    better: Chain
    moments: Moments


def climbed(state_at: Callable[[Chain, Array], State], chain: Chain, variances: Array) -> State:
    """The likeliest state found from a start."""
    here = state_at(chain, variances)
    for _ in range(ROUNDS):
        there = state_at(here.better, here.moments.scored())
        if there.log_likelihood < here.log_likelihood:
            there = state_at(here.better, here.moments.surely(here.variances))
        gained = there.log_likelihood - here.log_likelihood
        if gained > 0:
            here = there
        if gained < SETTLED:
            break
    return here


def first_variances(residuals: Array, directions: list[Array]) -> Array:
    """Every source of a kind takes the same share of what the start leaves (n, 6)."""
    rotation, translation = np.median(residuals[:, :3] ** 2) + 1e-12, np.median(residuals[:, 3:] ** 2) + 1e-6
    size = np.array([np.mean(direction**2, axis=(0, 2)) for direction in directions])
    turns, shifts = size[:, :3].sum(axis=1), size[:, 3:].sum(axis=1)
    share: Array = np.minimum(
        np.where(turns > 1e-12, rotation / np.maximum(turns, 1e-12), np.inf),
        np.where(shifts > 1e-12, translation / np.maximum(shifts, 1e-12), np.inf),
    )
    return share / 2


def spent_on(normal: Array) -> float:
    """What the unknowns with this normal matrix take from the log-likelihood."""
    return 0.5 * float(len(normal) * np.log(2 * np.pi) - np.linalg.slogdet(normal)[1])
