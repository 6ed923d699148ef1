"""By chance alone, how often would a session without a fault look as guilty? Wald's test, averaged over noise levels.

d, the estimate of what a fault would change, has the covariance V, and with known noise d' V^-1 d is chi-squared. The
robot's two levels are known only from the same views: the chance is averaged over them, each pair as likely as the
residuals make it (restricted likelihood) times what robots are like. Of one level that is the F test; of two no closed
form is right where few views tell little about one of them.
Source: D. Harville, "Bayesian inference for variance components using only error contrasts", Biometrika 61, 1974.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
import scipy

from calibration.diagnosis.fit import SMALLEST_INFORMATION, SMALLEST_VARIANCE, Fit
from calibration.kinematics.robot_accuracy import PRIOR_FACTOR, PRIOR_NOISE
from calibration.linear_algebra import (
    inverse_or_pseudo_inverse,
    scaled_inverse_and_log_determinant,
    scaled_solve,
    squared_distances,
)
from calibration.transforms import Array

GRIDS = (5, 5, 7)
"""Nodes of each level, in grids that close in on the levels that are likely."""

FIRST_STEP = 1.0
"""Between nodes of the first grid, in logarithms of a level's deviation."""

REACH = np.array([-2.0, 4.0])
"""Of the last grid, in deviations: high levels matter most to a small chance."""

FINER = 0.4
"""A grid does not tell a deviation smaller than this share of its steps."""


@dataclass(frozen=True, eq=False)
class Background:
    """What a fit leaves uncertain at k pairs of the robot's levels, `weights` (k,) of which each is the true one.

    `variances` (k, 2); what the shared unknowns still lack (k, p), and its covariance (k, p, p).
    """

    fitted: Fit
    weights: Array
    variances: Array
    steps: Array
    shared: Array

    @classmethod
    def of(cls, fitted: Fit) -> "Background":
        """About the levels that the fit took for the likeliest."""
        centre = 0.5 * np.log(np.maximum(fitted.variances, SMALLEST_VARIANCE))
        reach = np.outer(np.array([-0.5, 0.5]) * (GRIDS[0] - 1) * FIRST_STEP, np.ones(2))
        for nodes in GRIDS:
            axes = np.linspace(centre + reach[0], centre + reach[1], nodes)
            logs = np.array(list(product(*axes.T)))
            found = cls._at(fitted, logs)
            centre = found.weights @ logs
            spread = np.sqrt(found.weights @ (logs - centre) ** 2)
            reach = np.outer(REACH, np.maximum(spread, FINER * (axes[1] - axes[0])))
        return found

    @classmethod
    def _at(cls, fitted: Fit, logs: Array) -> "Background":
        """At deviations whose logarithms are `logs` (k, 2)."""
        variances = np.maximum(np.exp(2 * logs), SMALLEST_VARIANCE)
        spread = fitted.by_robot * np.sqrt(np.repeat(variances, 3, axis=1))[:, None, None]
        covariance = fitted.image_covariance + spread @ np.swapaxes(spread, -1, -2)
        by_shared = fitted.by_shared
        n, _, p = by_shared.shape
        # Views stacked: (k, p, 6 n) @ (6 n, p + 1)
        information = inverse_or_pseudo_inverse(covariance)
        weighted = np.swapaxes((information @ by_shared).reshape(len(logs), 6 * n, p), 1, 2)
        both = weighted @ np.concatenate([by_shared, fitted.residuals[..., None]], axis=2).reshape(6 * n, p + 1)
        normal, gradient = both[:, :, :p], both[:, :, p]
        shared, log_determinant = scaled_inverse_and_log_determinant(normal)
        steps = -(shared @ gradient[..., None])[..., 0]
        weighted_residuals = (information @ fitted.residuals[..., None])[..., 0]
        square = np.sum(weighted_residuals * fitted.residuals, axis=(1, 2)) + np.sum(steps * gradient, axis=1)
        determinants = np.linalg.slogdet(covariance)[1].sum(axis=1) + log_determinant
        stated = np.sum(((logs - np.log(PRIOR_NOISE.levels())) / np.log(PRIOR_FACTOR)) ** 2, axis=1)
        likely = -0.5 * (determinants + square + stated)
        weights = np.exp(likely - likely.max())
        return cls(fitted, weights / weights.sum(), variances, steps, shared)

    def chance_of(self, value: Array, by_unknowns: Array) -> float:
        """`value` (d,) is the fit's `by_unknowns` (d, p) @ the shared unknowns: is the truth zero, by chance as far?"""
        off = value + self.steps @ by_unknowns.T
        return self._chance(off, by_unknowns @ self.shared @ by_unknowns.T)

    def _chance(self, off: Array, covariance: Array) -> float:
        """Of values (k, d) with covariances (k, d, d)."""
        return float(self.weights @ scipy.stats.chi2.sf(squared_distances(off, covariance), off.shape[1]))

    def of_outsider(self, seen: Fit) -> "Outsider":
        """A view that took no part in the fit, as `fit.applied` sees it."""
        by_shared, spread = seen.by_shared[0], seen.by_robot[0] * np.sqrt(np.repeat(self.variances, 3, axis=1))[:, None]
        own = seen.image_covariance[0] + spread @ np.swapaxes(spread, 1, 2)
        return Outsider(self, seen.residuals[0], self.steps @ by_shared.T, own + by_shared @ self.shared @ by_shared.T)


@dataclass(frozen=True, eq=False)
class Outsider:
    """A view against all others: its residual (6,) under their fit; at each pair of the background's levels what is to
    be added (k, 6), for they would be fitted otherwise, and the covariance (k, 6, 6)."""

    background: Background
    residual: Array
    steps: Array
    covariances: Array

    def chance_off(self) -> float:
        """That it is off so far in any way."""
        return self.chance_of(self.residual)

    def chance_of(self, residual: Array) -> float:
        """That another residual (6,), if it had that, were so far off."""
        return self.background._chance(residual + self.steps, self.covariances)

    def chance_along(self, slopes: Array) -> Array:
        """That it is off so far by some multiple of each of the `slopes` (m, 6)."""
        directions = np.linalg.solve(self.covariances, slopes.T)  # (k, 6, m)
        own = np.maximum(np.sum(slopes.T * directions, axis=1), SMALLEST_INFORMATION)
        squares = np.sum((self.residual + self.steps)[:, :, None] * directions, axis=1) ** 2 / own
        chances: Array = self.background.weights @ scipy.stats.chi2.sf(squares, 1)
        return chances

    def fitting(self, slopes: Array) -> Array:
        """Multiples (m,) of each of the `slopes` (m, 6) that, added, leave least."""
        step, covariance = self._averaged()
        directions = scaled_solve(covariance, slopes.T)  # (6, m)
        own = np.maximum(np.sum(slopes.T * directions, axis=0), SMALLEST_INFORMATION)
        multiples: Array = -((self.residual + step) @ directions) / own
        return multiples

    def squares(self, residuals: Array) -> Array:
        """Squared distance (m,) of other residuals (m, 6) that the view could have."""
        step, covariance = self._averaged()
        off = residuals + step
        squares: Array = np.sum(off.T * scaled_solve(covariance, off.T), axis=0)
        return squares

    def _averaged(self) -> tuple[Array, Array]:
        """Over all levels: (6,), (6, 6)."""
        weights = self.background.weights
        mean = weights @ self.steps
        off = self.steps - mean
        return mean, np.tensordot(weights, self.covariances, 1) + (weights[:, None] * off).T @ off
