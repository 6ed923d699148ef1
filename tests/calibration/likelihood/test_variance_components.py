"""Fisher scoring of two variances that may be zero, as by non-negative least squares."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import nnls

from calibration.likelihood.variance_components import nonnegative_variances


@given(
    seed=st.integers(0, 10_000), correlation=st.floats(0.0, 0.999), units=st.tuples(st.floats(-5, 5), st.floats(-5, 5))
)
def test_two_variances_are_those_of_non_negative_least_squares(
    seed: int, correlation: float, units: tuple[float, float]
) -> None:
    """Both where both may be positive, else one; whatever their units."""
    scale = 10.0 ** np.array(units)
    score = np.random.default_rng(seed).standard_normal((8, 2))
    fisher = np.array([[1.0, correlation], [correlation, 1.0]])
    root = np.linalg.cholesky(fisher)
    expected = [nnls(root.T, np.linalg.solve(root, one))[0] for one in score]
    found = nonnegative_variances(np.tile(fisher * np.outer(scale, scale), (8, 1, 1)), score * scale)
    np.testing.assert_allclose(found * scale, expected, rtol=1e-6, atol=1e-9)


def test_variances_that_nothing_distinguishes_are_one() -> None:
    found = nonnegative_variances(np.ones((2, 2)), np.array([1.0, 0.5]))
    np.testing.assert_allclose(found, [1.0, 0.0])
