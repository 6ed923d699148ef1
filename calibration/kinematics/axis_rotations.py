"""Rotations about the coordinate axes."""

from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from calibration.transforms import Array


def wrap(angles: Array) -> Array:
    """Angles in (-pi, pi]."""
    return angles - 2 * np.pi * np.ceil((angles - np.pi) / (2 * np.pi))


def rotation_about(axis: int, angle: ArrayLike) -> Array:
    """Rotations (..., 3, 3) about axis 0, 1 or 2, angle (...) in rad."""
    angle, first, second = np.asarray(angle, float), (axis + 1) % 3, (axis + 2) % 3
    result = np.zeros((*angle.shape, 3, 3))
    result[..., range(3), range(3)] = 1.0
    result[..., first, first] = result[..., second, second] = np.cos(angle)
    result[..., second, first] = np.sin(angle)
    result[..., first, second] = -np.sin(angle)
    return result


rotation_x, rotation_y, rotation_z = (partial(rotation_about, axis) for axis in range(3))
"""Rotations (..., 3, 3) about x, y or z, angle (...) in rad."""
