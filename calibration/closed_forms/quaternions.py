"""Products of scalar-first quaternions as matrices: p q = left_product_matrix(p) @ q = right_product_matrix(q) @ p."""

import numpy as np

from calibration.transforms import Array, skew


def left_product_matrix(quaternions: Array) -> Array:
    """(k, 4, 4) of quaternions (k, 4)."""
    return _product_matrix(quaternions, 1.0)


def right_product_matrix(quaternions: Array) -> Array:
    """(k, 4, 4) of quaternions (k, 4)."""
    return _product_matrix(quaternions, -1.0)


def _product_matrix(quaternions: Array, sign: float) -> Array:
    scalar, vector = quaternions[:, 0], quaternions[:, 1:]
    result = np.zeros((len(quaternions), 4, 4))
    result[:, 0, 0], result[:, 0, 1:], result[:, 1:, 0] = scalar, -vector, vector
    result[:, 1:, 1:] = scalar[:, None, None] * np.eye(3) + sign * skew(vector)
    return result
