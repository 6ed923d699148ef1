"""Chi-squared, Fisher's F and the polygamma functions, as `scipy.special` has them.

Most calibrations need nothing else of SciPy, whose import takes as much processor time as the estimate.
Sources: NIST Digital Library of Mathematical Functions, 8.4 and 8.8 (recurrence), 8.17(v) (continued fraction) and 5.15
(series); W. Press et al., Numerical Recipes, 2007, 5.2 (Lentz's method).
"""

from math import erfc, exp, gamma, lgamma, log, nan

import numpy as np

from calibration.transforms import Array

MAX_TERMS = 100_000
TOLERANCE = 1e-15
TINY = 1e-300
"""In place of zero in a denominator."""

LOG_RATIOS = (-700.0, 700.0)
"""Logarithms of the ratios between which a quantile is sought."""

HALVINGS = 60

MAX_HALF_SQUARE = 1e4
"""Of chi-squared; a larger one has no probability left in double precision."""

SHIFT = 16
"""By which the argument of a polygamma function is raised until the series has 14 digits."""


def chi_squared_tail(freedom: int, squares: Array | float) -> Array:
    """Probabilities of larger values than `squares`, of any shape, under chi-squared; `freedom`: 1 or more, and few."""
    given = np.asarray(squares, float)
    half = np.where(given < 0, nan, np.minimum(given / 2, MAX_HALF_SQUARE))
    if freedom == 1:
        return np.asarray(np.vectorize(erfc, otypes=[float])(np.sqrt(half)))
    if freedom == 2:
        return np.exp(-half)
    return chi_squared_tail(freedom - 2, squares) + half ** (freedom / 2 - 1) * np.exp(-half) / gamma(freedom / 2)


def f_tail(numerator: float, denominator: float, ratio: float) -> float:
    """Probability of a larger ratio under F with these degrees of freedom; nan where they are not positive."""
    if not (numerator > 0 and denominator > 0 and ratio >= 0):
        return nan
    above, below = numerator * ratio, denominator
    return _incomplete_beta(denominator / 2, numerator / 2, below / (below + above), above / (below + above))


def f_quantile(numerator: float, denominator: float, tail: float) -> float:
    """The ratio that F with these degrees of freedom exceeds with probability `tail`; nan where `f_tail` is."""
    if not (numerator > 0 and denominator > 0):
        return nan
    low, high = LOG_RATIOS
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        if f_tail(numerator, denominator, exp(middle)) > tail:
            low = middle
        else:
            high = middle
    return exp((low + high) / 2)


def trigamma(x: Array | float) -> Array:
    """Second derivative of log gamma at positive `x`."""
    z = x + SHIFT
    series = (1 + (0.5 + (1 / 6 - (1 / 30 - (1 / 42 - 1 / (30 * z**2)) / z**2) / z**2) / z) / z) / z
    return np.asarray(series + np.sum(1 / np.add.outer(np.arange(SHIFT), x) ** 2, axis=0))


def tetragamma(x: Array | float) -> Array:
    """Third derivative of log gamma at positive `x`."""
    z = x + SHIFT
    series = -(1 + (1 + (0.5 - (1 / 6 - (1 / 6 - 0.3 / z**2) / z**2) / z**2) / z) / z) / z**2
    return np.asarray(series - np.sum(2 / np.add.outer(np.arange(SHIFT), x) ** 3, axis=0))


def _incomplete_beta(a: float, b: float, x: float, rest: float) -> float:
    """The regularised incomplete beta function at `x`, with `rest` = 1 - x."""
    if x <= 0 or rest <= 0:
        return float(rest <= 0)
    if x > (a + 1) / (a + b + 2):
        return 1 - _continued_fraction(b, a, rest, x)
    return _continued_fraction(a, b, x, rest)


def _continued_fraction(a: float, b: float, x: float, rest: float) -> float:
    """As `_incomplete_beta`, quick for `x` up to about (a + 1) / (a + b + 2)."""
    front = exp(lgamma(a + b) - lgamma(a) - lgamma(b) + a * log(x) + b * log(rest)) / a
    c, d = 1.0, 1 / _away_from_zero(1 - (a + b) * x / (a + 1))
    fraction = d
    for m in range(1, MAX_TERMS):
        even = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m))
        odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1))
        for term in (even, odd):
            c, d = _away_from_zero(1 + term / c), 1 / _away_from_zero(1 + term * d)
            fraction *= c * d
        if abs(c * d - 1) < TOLERANCE:
            break
    return front * fraction


def _away_from_zero(value: float) -> float:
    return value if abs(value) > TINY else TINY
