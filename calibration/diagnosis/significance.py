"""By chance alone, how often would a session without a fault look as guilty? Wald's test with estimated noise.

d, the estimate of what a fault would change, has the covariance V. With known noise d' V^-1 d is chi-squared; here V
rests on two levels of robot noise estimated from the same views, and k F(k, nu) takes its place, with nu from the
levels' own uncertainty (Satterthwaite, Biometrics Bulletin 2(6), 1946; for several numbers at once Fai & Cornelius,
J. Statist. Comput. Simul. 54, 1996).
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import f as fisher

from calibration.diagnosis.fit import SMALLEST_INFORMATION, Fit, inverted
from calibration.transforms import Array

LEVER_MM = 573.0 / 3, 573.0 * 3
"""Translation noise over rotation noise, in mm per radian: 0.05 mm and 0.005 degrees, the usual levels, make 573. Few
views may blame one level alone for what both did; they are not believed to lie further apart than three times that."""

FEWEST_DEGREES, MOST_DEGREES = 1.0, 1e6


@dataclass(frozen=True, eq=False)
class Test:
    """`square`: d' V^-1 d with `numbers` = dim d and `degrees` = nu."""

    square: float
    numbers: int
    degrees: float

    @property
    def chance(self) -> float:
        """That a session without the fault exceeds it."""
        return float(fisher.sf(self.square / self.numbers, self.numbers, self.degrees))


@dataclass(frozen=True, eq=False)
class Background:
    """What a fit leaves uncertain. `normal` (p, p) inverted; weighted derivatives (n, 6, p); the levels' (2, 2)."""

    fitted: Fit
    shared: Array
    weighted: Array
    levels: Array

    @classmethod
    def of(cls, fitted: Fit) -> "Background":
        """The levels of a few views are not believed when one of the two is all but missing."""
        fitted = _with_both_levels(fitted)
        weights = inverted(fitted.covariance)
        weighted = weights @ fitted.by_shared
        n, _, p = weighted.shape
        normal = (np.swapaxes(fitted.by_shared, 1, 2) @ weighted).sum(axis=0)
        scale = 1 / np.sqrt(np.maximum(np.diagonal(normal), SMALLEST_INFORMATION))
        shared = scale[:, None] * inverted(scale[:, None] * normal * scale + 1e-12 * np.eye(p)) * scale
        inner = np.swapaxes(fitted.by_robot, 1, 2) @ weights @ fitted.by_robot
        told = 0.5 * np.sum((inner**2).reshape(n, 2, 3, 2, 3), axis=(0, 2, 4)) * max(1 - p / (6 * n), 1 / (6 * n))
        size = 1 / np.sqrt(np.maximum(np.diagonal(told), SMALLEST_INFORMATION))
        levels = size[:, None] * inverted(size[:, None] * told * size + 1e-9 * np.eye(2)) * size
        return cls(fitted, shared, weighted, levels)

    def of_shared(self, value: Array, by_unknowns: Array) -> Test:
        """`value` (k,) estimates `by_unknowns` (k, p) @ the shared unknowns; should it be zero?"""
        lever = self.shared @ by_unknowns.T
        return self._test(value, by_unknowns @ lever, lever, None)

    def of_outsider(self, seen: Fit) -> "Outsider":
        """A view that took no part in the fit, as `fit.applied` sees it."""
        lever = self.shared @ seen.by_shared[0].T
        return Outsider(self, seen, seen.covariance[0] + seen.by_shared[0] @ lever, lever)

    def _test(self, value: Array, variance: Array, lever: Array, outsider: Fit | None) -> Test:
        direction = _solved(variance, value)
        square = max(float(value @ direction), 0.0)
        return Test(square, len(value), self.degrees(direction, square, lever, outsider))

    def degrees(self, direction: Array, square: float, lever: Array, outsider: Fit | None) -> float:
        """nu of `square`, the variance of direction' d; by how much it follows each level, and each view's pixels."""
        by_level, doubt = _doubt(self.fitted, self.weighted @ (lever @ direction))
        if outsider is not None:
            its_own, its_doubt = _doubt(outsider, direction[None])
            by_level, doubt = by_level + its_own, doubt + its_doubt
        doubt += float(by_level @ self.levels @ by_level)
        return float(np.clip(2 * square**2 / max(doubt, 1e-300), FEWEST_DEGREES, MOST_DEGREES))


@dataclass(frozen=True, eq=False)
class Outsider:
    """A view against all others: is it off at all, or along one direction?"""

    background: Background
    seen: Fit
    variance: Array
    lever: Array

    def off(self) -> Test:
        """In any way."""
        return self.background._test(self._residual, self.variance, self.lever, self.seen)

    def off_along(self, slope: Array) -> Test:
        """By some multiple of `slope` (6,)."""
        direction = _solved(self.variance, slope)
        own = max(float(slope @ direction), SMALLEST_INFORMATION)
        square = float(direction @ self._residual) ** 2 / own
        return Test(square, 1, self.background.degrees(direction, own, self.lever, self.seen))

    @property
    def _residual(self) -> Array:
        residual: Array = self.seen.residuals[0]
        return residual

    def fitting(self, slope: Array) -> float:
        """The multiple of `slope` (6,) that, added, leaves least."""
        direction = _solved(self.variance, slope)
        return -float(direction @ self._residual) / max(float(slope @ direction), SMALLEST_INFORMATION)

    def left_by(self, residuals: Array) -> Array:
        """Squared distance (k,) of other residuals (k, 6) that the view could have."""
        squares: Array = np.einsum("ki,ik->k", residuals, _solved(self.variance, residuals.T))
        return squares


def _with_both_levels(fitted: Fit) -> Fit:
    """The fit under levels that lie within what robots show of each other."""
    rotation, translation = fitted.variances
    nearest, furthest = np.square(LEVER_MM)
    levels = np.maximum(fitted.variances, [translation / furthest, rotation * nearest])
    added = np.repeat(levels - fitted.variances, 3)
    if not np.any(added):
        return fitted
    spread = fitted.by_robot * added
    return replace(fitted, covariance=fitted.covariance + spread @ np.swapaxes(fitted.by_robot, 1, 2), variances=levels)


def _doubt(fitted: Fit, spread: Array) -> tuple[Array, float]:
    """Of the variance of sum spread' residuals, `spread` (n, 6): its derivatives (2,) by the robot's levels, and how
    uncertain it is because each view's pixel noise is known from that view's few pixels only."""
    by_robot = (np.swapaxes(fitted.by_robot, 1, 2) @ spread[..., None])[..., 0]
    by_level = (by_robot**2).reshape(-1, 2, 3).sum(axis=-1)
    whole = np.einsum("ni,nij,nj->n", spread, fitted.covariance, spread)
    by_pixels: Array = np.maximum(whole - by_level @ fitted.variances, 0.0)
    return by_level.sum(axis=0), float(np.sum(2 * by_pixels**2 / fitted.redundancy))


def _solved(matrix: Array, right_hand: Array) -> Array:
    scale = 1 / np.sqrt(np.maximum(np.diagonal(matrix), SMALLEST_INFORMATION))
    scaled = inverted(scale[:, None] * matrix * scale + 1e-12 * np.eye(len(matrix)))
    solved: Array = (scale[:, None] * scaled * scale) @ right_hand
    return solved
