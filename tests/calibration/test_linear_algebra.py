"""Inverses of matrices in radians and millimetres: numpy's where all is determined, as documented where it is not."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calibration.linear_algebra import (
    MIN_EIGENVALUE,
    RIDGE,
    covariance_of,
    covariance_or_inf,
    inverse_or_pseudo_inverse,
    scaled_inverse,
    scaled_inverse_and_log_determinant,
    scaled_pseudo_inverse,
    scaled_solve,
    squared_distances,
    unit_diagonal,
)
from calibration.transforms import Array

SIZE = 6
SEEDS = st.integers(0, 10_000)
UNITS = st.lists(st.floats(-5, 5), min_size=SIZE, max_size=SIZE).map(lambda powers: 10.0 ** np.array(powers))

Inverse = Callable[[Array], Array]
SCALED: dict[str, Inverse] = {
    "covariance_of": covariance_of,
    "covariance_or_inf": lambda matrices: covariance_or_inf(matrices, SIZE),
    "scaled_pseudo_inverse": lambda matrices: scaled_pseudo_inverse(matrices, 1e-10),
    "scaled_inverse": scaled_inverse,
    "scaled_inverse_and_log_determinant": lambda matrices: scaled_inverse_and_log_determinant(matrices)[0],
    "scaled_solve": lambda matrices: scaled_solve(matrices, np.broadcast_to(np.eye(SIZE), matrices.shape)),
}


def information(seed: int, *stack: int) -> Array:
    """J' J (..., 6, 6) of random derivatives by six unknowns: every direction is well determined."""
    derivatives = np.random.default_rng(seed).standard_normal((*stack, 30, SIZE))
    return np.asarray(np.swapaxes(derivatives, -1, -2) @ derivatives)


def undetermined(seed: int) -> Array:
    """The same without information on one direction, which is none of the unknowns alone."""
    values, vectors = np.linalg.eigh(information(seed))
    return np.asarray((vectors[:, 1:] * values[1:]) @ vectors[:, 1:].T)


def largest_variance(inverse: Array, matrix: Array) -> float:
    """Of an unknown, in units of what it would be if all others were known."""
    return float(np.max(np.diagonal(inverse) * np.diagonal(matrix)))


@pytest.mark.parametrize("name", [*SCALED, "inverse_or_pseudo_inverse"])
@given(seed=SEEDS)
def test_a_regular_matrix_has_the_inverse_of_numpy(name: str, seed: int) -> None:
    matrices = information(seed, 2, 3)
    inverse = SCALED.get(name, inverse_or_pseudo_inverse)
    np.testing.assert_allclose(inverse(matrices), np.linalg.inv(matrices), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("name", SCALED)
@given(seed=SEEDS, units=UNITS)
def test_other_units_change_the_units_of_the_inverse_only(name: str, seed: int, units: Array) -> None:
    matrix, both = information(seed), np.outer(units, units)
    np.testing.assert_allclose(SCALED[name](matrix * both) * both, SCALED[name](matrix), rtol=1e-6, atol=1e-9)


@given(seed=SEEDS, units=UNITS)
def test_the_log_determinant_is_that_of_numpy(seed: int, units: Array) -> None:
    matrices = information(seed, 3) * np.outer(units, units)
    found = scaled_inverse_and_log_determinant(matrices)[1]
    np.testing.assert_allclose(found, np.linalg.slogdet(matrices)[1], rtol=1e-9, atol=1e-9)


@given(seed=SEEDS, units=UNITS)
def test_squared_distances_are_those_of_mahalanobis(seed: int, units: Array) -> None:
    off = np.random.default_rng(seed).standard_normal((4, SIZE))
    covariance = information(seed, 4)
    expected = [vector @ np.linalg.inv(one) @ vector for vector, one in zip(off, covariance, strict=True)]
    found = squared_distances(off * units, covariance * np.outer(units, units))
    np.testing.assert_allclose(found, expected, rtol=1e-6)


@given(seed=SEEDS, units=UNITS)
def test_an_undetermined_direction_gets_a_large_finite_variance(seed: int, units: Array) -> None:
    matrix = undetermined(seed) * np.outer(units, units)
    covariance = covariance_of(matrix)
    assert 0.01 / MIN_EIGENVALUE < largest_variance(covariance, matrix) < 1.01 / MIN_EIGENVALUE
    assert np.linalg.eigvalsh(unit_diagonal(covariance)[0])[0] > -1e-9


@given(seed=SEEDS, units=UNITS)
def test_one_undetermined_direction_makes_all_variances_infinite(seed: int, units: Array) -> None:
    both = np.outer(units, units)
    singular, regular = covariance_or_inf(np.array([undetermined(seed), information(seed)]) * both, 3)
    np.testing.assert_array_equal(singular, np.diag(np.full(3, np.inf)))
    expected = np.linalg.inv(information(seed))[:3, :3] / both[:3, :3]
    np.testing.assert_allclose(regular * both[:3, :3], expected * both[:3, :3], rtol=1e-6, atol=1e-9)


@given(seed=SEEDS, units=UNITS)
def test_a_step_by_the_pseudo_inverse_leaves_an_undetermined_direction_alone(seed: int, units: Array) -> None:
    matrix = undetermined(seed) * np.outer(units, units)
    inverse = scaled_pseudo_inverse(matrix, 1e-10)
    scaled, scale = unit_diagonal(matrix)
    direction = np.linalg.eigh(scaled)[1][:, 0]
    step = inverse @ (matrix @ (scale * np.ones(SIZE)))
    assert abs(direction @ (step / scale)) < 1e-6
    np.testing.assert_allclose(matrix @ inverse @ matrix, matrix, atol=1e-9 * np.abs(matrix).max())


@given(seed=SEEDS, units=UNITS)
def test_a_ridge_bounds_the_variance_of_an_undetermined_direction(seed: int, units: Array) -> None:
    matrix = undetermined(seed) * np.outer(units, units)
    for inverse in (scaled_inverse(matrix), scaled_inverse_and_log_determinant(matrix)[0]):
        assert 0.01 / RIDGE < largest_variance(inverse, matrix) < 1.01 / RIDGE
    assert largest_variance(scaled_inverse(matrix, 1e-6), matrix) < 1.01e6


@given(seed=SEEDS, units=UNITS)
def test_a_solvable_singular_system_is_solved(seed: int, units: Array) -> None:
    matrix = undetermined(seed) * np.outer(units, units)
    right_hand = matrix @ (unit_diagonal(matrix)[1] * np.random.default_rng(seed).standard_normal(SIZE))[:, None]
    scaled_error = unit_diagonal(matrix)[1][:, None] * (matrix @ scaled_solve(matrix, right_hand) - right_hand)
    np.testing.assert_allclose(scaled_error, 0.0, atol=1e-3)


@pytest.mark.parametrize("name", [*SCALED, "inverse_or_pseudo_inverse"])
def test_an_unknown_without_any_information_divides_by_nothing(name: str) -> None:
    """Warnings are errors here: neither zero nor infinity may be divided by."""
    nothing = np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 0.0])
    inverse = SCALED.get(name, inverse_or_pseudo_inverse)(nothing)
    if name == "covariance_or_inf":
        assert np.all(np.isinf(np.diagonal(inverse)))
    else:
        np.testing.assert_allclose(inverse[:5, :5], np.diag(1 / np.arange(1.0, 6.0)), rtol=1e-9)


def test_a_matrix_that_is_not_positive_has_an_infinite_determinant_beside_one_that_is() -> None:
    inverses, log_determinants = scaled_inverse_and_log_determinant(
        np.array([np.diag([4.0, 9.0]), [[1.0, 2.0], [2.0, 1.0]]])
    )
    np.testing.assert_allclose(log_determinants, [np.log(36), np.inf])
    np.testing.assert_allclose(inverses[0], np.diag([1 / 4, 1 / 9]))
    assert np.all(np.isfinite(inverses))
