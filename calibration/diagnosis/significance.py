"""p values of faults: Wald's test, averaged over the noise levels.

d, the estimate of what a fault would change, has the covariance V, and with known noise d' V^-1 d is chi-squared. The
robot's two levels are estimated from the same views, so the p value is averaged over them, weighted by the restricted
likelihood times a prior. With one level that is the F test; with two levels there is no closed form for few views.
Source: D. Harville, "Bayesian inference for variance components using only error contrasts", Biometrika 61, 1974.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np

from calibration.diagnosis.fit import MIN_INFORMATION, MIN_VARIANCES, Fit
from calibration.kinematics.robot_accuracy import PRIOR_FACTOR, PRIOR_NOISE
from calibration.likelihood.distributions import chi_squared_tail
from calibration.linear_algebra import (
    inverse_or_pseudo_inverse,
    mixture_moments,
    scaled_inverse_and_log_determinant,
    scaled_solve,
    squared_distances,
)
from calibration.transforms import Array

GRIDS = (5, 5, 7)
"""Nodes for each level, of successive grids that narrow to the likely levels."""

FIRST_STEP = 1.0
"""Between nodes of the first grid, in logarithms of a level's standard deviation."""

REACH = np.array([-2.0, 4.0])
"""Bounds of the next grid, in standard deviations; further up, since high levels dominate a small p value."""

MIN_RESOLUTION = 0.4
"""Least standard deviation that a grid resolves, as a share of its step."""


@dataclass(frozen=True, eq=False)
class NoisePosterior:
    """The posterior of a fit at k pairs of the robot's noise levels.

    weights : (k,) probabilities of the pairs.
    variances : (k, 2) rad², mm².
    steps, shared : steps of the shared unknowns (k, p) from the fit, and their covariance (k, p, p). Errors of an
        estimated camera, whose prior standard deviations are 1, follow the unknowns of the fit.
    """

    fitted: Fit
    weights: Array
    variances: Array
    steps: Array
    shared: Array

    @classmethod
    def of(cls, fitted: Fit, by_camera: Array | None) -> "NoisePosterior":
        """The posterior on grids about the fit's levels; `by_camera`: see `Evidence`."""
        centre = 0.5 * np.log(np.maximum(fitted.variances, MIN_VARIANCES))
        reach = np.outer(np.array([-0.5, 0.5]) * (GRIDS[0] - 1) * FIRST_STEP, np.ones(2))
        for nodes in GRIDS:
            axes = np.linspace(centre + reach[0], centre + reach[1], nodes)
            logs = np.array(list(product(*axes.T)))
            found = cls._at(fitted, by_camera, logs)
            centre = found.weights @ logs
            spread = np.sqrt(found.weights @ (logs - centre) ** 2)
            reach = np.outer(REACH, np.maximum(spread, MIN_RESOLUTION * (axes[1] - axes[0])))
        return found

    @classmethod
    def _at(cls, fitted: Fit, by_camera: Array | None, logs: Array) -> "NoisePosterior":
        """The posterior at standard deviations with logarithms `logs` (k, 2)."""
        variances = np.maximum(np.exp(2 * logs), MIN_VARIANCES)
        spread = fitted.by_robot * np.sqrt(np.repeat(variances, 3, axis=1))[:, None, None]
        covariance = fitted.image_covariance + spread @ np.swapaxes(spread, -1, -2)
        by_shared = _with_camera(fitted.by_shared, by_camera)
        n, _, p = by_shared.shape
        known = np.diag((np.arange(p) >= fitted.by_shared.shape[2]).astype(float))
        # Views stacked: (k, p, 6 n) @ (6 n, p + 1)
        information = inverse_or_pseudo_inverse(covariance)
        weighted = np.swapaxes((information @ by_shared).reshape(len(logs), 6 * n, p), 1, 2)
        both = weighted @ np.concatenate([by_shared, fitted.residuals[..., None]], axis=2).reshape(6 * n, p + 1)
        normal, gradient = both[:, :, :p] + known, both[:, :, p]
        shared, log_determinant = scaled_inverse_and_log_determinant(normal)
        steps = -(shared @ gradient[..., None])[..., 0]
        weighted_residuals = (information @ fitted.residuals[..., None])[..., 0]
        square = np.sum(weighted_residuals * fitted.residuals, axis=(1, 2)) + np.sum(steps * gradient, axis=1)
        determinants = np.linalg.slogdet(covariance)[1].sum(axis=1) + log_determinant
        stated = np.sum(((logs - np.log(PRIOR_NOISE.levels())) / np.log(PRIOR_FACTOR)) ** 2, axis=1)
        likely = -0.5 * (determinants + square + stated)
        weights = np.exp(likely - likely.max())
        return cls(fitted, weights / weights.sum(), variances, steps, shared)

    def p_value_of(self, value: Array, by_unknowns: Array) -> float:
        """p value of `value` (d,), the fit's `by_unknowns` (d, p) @ shared unknowns, when the truth is zero."""
        p = by_unknowns.shape[1]
        off = value + self.steps[:, :p] @ by_unknowns.T
        return self._p_value(off, by_unknowns @ self.shared[:, :p, :p] @ by_unknowns.T)

    def _p_value(self, off: Array, covariance: Array) -> float:
        """p value of values (k, d) with covariances (k, d, d) at the k pairs of levels."""
        return float(self.weights @ chi_squared_tail(off.shape[1], squared_distances(off, covariance)))

    def outside_view(self, seen: Fit, by_camera: Array | None) -> "OutsideView":
        """A view that is not part of the fit; `seen` is its `fit.apply_fit`, `by_camera` that of its evidence."""
        by_shared = _with_camera(seen.by_shared, by_camera)[0]
        spread = seen.by_robot[0] * np.sqrt(np.repeat(self.variances, 3, axis=1))[:, None]
        own = seen.image_covariance[0] + spread @ np.swapaxes(spread, 1, 2)
        return OutsideView(
            self, seen.residuals[0], self.steps @ by_shared.T, own + by_shared @ self.shared @ by_shared.T
        )


@dataclass(frozen=True, eq=False)
class OutsideView:
    """A view against all others: its residual (6,) under their fit; at each pair of noise levels the change of that
    residual (k, 6) by the fit's step, and its covariance (k, 6, 6)."""

    background: NoisePosterior
    residual: Array
    steps: Array
    covariances: Array

    def p_value_of(self, residual: Array) -> float:
        """p value of a residual (6,) in the place of the view's."""
        return self.background._p_value(residual + self.steps, self.covariances)

    def p_values_along(self, slopes: Array) -> Array:
        """p values (m,) of the view's residual along each of the `slopes` (m, 6)."""
        directions = np.linalg.solve(self.covariances, slopes.T)  # (k, 6, m)
        own = np.maximum(np.sum(slopes.T * directions, axis=1), MIN_INFORMATION)
        squares = np.sum((self.residual + self.steps)[:, :, None] * directions, axis=1) ** 2 / own
        chances: Array = self.background.weights @ chi_squared_tail(1, squares)
        return chances

    def best_multiples(self, slopes: Array) -> Array:
        """Multiples (m,) of each of the `slopes` (m, 6) that minimise the residual when added."""
        step, covariance = self._moments()
        directions = scaled_solve(covariance, slopes.T)  # (6, m)
        own = np.maximum(np.sum(slopes.T * directions, axis=0), MIN_INFORMATION)
        multiples: Array = -((self.residual + step) @ directions) / own
        return multiples

    def squares(self, residuals: Array) -> Array:
        """Squared distances (m,) of other residuals (m, 6) in the place of the view's."""
        step, covariance = self._moments()
        off = residuals + step
        squares: Array = np.sum(off.T * scaled_solve(covariance, off.T), axis=0)
        return squares

    def _moments(self) -> tuple[Array, Array]:
        """Mean step (6,) and covariance (6, 6) over all levels."""
        return mixture_moments(self.background.weights, self.steps, self.covariances)


def _with_camera(by_shared: Array, by_camera: Array | None) -> Array:
    """Derivatives (n, 6, p) of the residuals by the unknowns of a fit and by the errors of an estimated camera."""
    return by_shared if by_camera is None else np.concatenate([by_shared, by_camera], axis=2)
