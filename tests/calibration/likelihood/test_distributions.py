"""Chi-squared, Fisher's F and the polygamma functions beside SciPy's."""

import numpy as np
import pytest
import scipy

from calibration.likelihood.distributions import chi_squared_tail, f_quantile, f_tail, tetragamma, trigamma

DEGREES = [(1, 3), (6, 3), (6, 78), (0.4, 1252.0), (30.0, 5145.0), (6689.0, 349.0)]


@pytest.mark.parametrize("freedom", range(1, 13))
def test_the_tail_of_chi_squared_is_scipys(freedom: int) -> None:
    squares = np.append(np.geomspace(1e-9, 1e3, 200), [0.0, np.inf, 1e300, np.nan, -1e-9, -1.0, -np.inf, 4.0]).reshape(
        4, -1
    )
    expected = scipy.special.chdtrc(freedom, squares)
    np.testing.assert_allclose(chi_squared_tail(freedom, squares), expected, rtol=1e-12, atol=1e-300)


@pytest.mark.parametrize(("numerator", "denominator"), DEGREES)
@pytest.mark.parametrize("ratio", [0.0, 0.02, 1.0, 3.3, 27.0])
def test_the_tail_is_scipys(numerator: float, denominator: float, ratio: float) -> None:
    expected = float(scipy.special.fdtrc(numerator, denominator, ratio))
    assert f_tail(numerator, denominator, ratio) == pytest.approx(expected, rel=1e-9, abs=1e-200)


@pytest.mark.parametrize(("numerator", "denominator"), DEGREES)
@pytest.mark.parametrize("tail", [1e-9, 1e-3, 0.5, 0.99])
def test_the_quantile_leaves_its_tail(numerator: float, denominator: float, tail: float) -> None:
    assert f_tail(numerator, denominator, f_quantile(numerator, denominator, tail)) == pytest.approx(tail, rel=1e-9)


@pytest.mark.parametrize(("numerator", "denominator", "ratio"), [(6, 0, 1.0), (np.nan, 3, 1.0), (6, 3, np.nan)])
def test_without_degrees_of_freedom_there_is_no_tail(numerator: float, denominator: float, ratio: float) -> None:
    assert np.isnan(f_tail(numerator, denominator, ratio))


@pytest.mark.parametrize("numerator", [1, 6, 59])
def test_where_the_fraction_changes_ends_the_tail_is_scipys(numerator: int) -> None:
    for denominator in range(1, 200):
        ratio = denominator * (numerator + 2) / (numerator * (denominator + 2))
        for near in (ratio, float(np.nextafter(ratio, 0)), float(np.nextafter(ratio, 9))):
            expected = float(scipy.special.fdtrc(numerator, denominator, near))
            assert f_tail(numerator, denominator, near) == pytest.approx(expected, rel=1e-9)


def test_without_degrees_of_freedom_there_is_no_quantile() -> None:
    assert np.isnan(f_quantile(1, -1, 0.01))


def test_polygamma_is_scipys() -> None:
    x = np.geomspace(0.05, 3000, 50)
    np.testing.assert_allclose(trigamma(x), scipy.special.polygamma(1, x), rtol=1e-12)
    np.testing.assert_allclose(tetragamma(x), scipy.special.polygamma(2, x), rtol=1e-12)
