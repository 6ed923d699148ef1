"""Rotations about the coordinate axes."""

import numpy as np
from numpy.typing import ArrayLike

from calibration.transforms import Array


def wrap(angles: Array) -> Array:
    """Angles in (-pi, pi]."""
    return angles - 2 * np.pi * np.ceil((angles - np.pi) / (2 * np.pi))


def _turns(angle: ArrayLike, first: int, second: int) -> Array:
    """Rotations (..., 3, 3) that turn axis `first` towards axis `second`."""
    angle = np.asarray(angle, float)
    result = np.zeros((*angle.shape, 3, 3))
    result[..., range(3), range(3)] = 1.0
    result[..., first, first] = result[..., second, second] = np.cos(angle)
    result[..., second, first] = np.sin(angle)
    result[..., first, second] = -np.sin(angle)
    return result


def rotation_x(angle: ArrayLike) -> Array:
    """Rotations (..., 3, 3) about x, angle (...) in rad."""
    return _turns(angle, 1, 2)


def rotation_y(angle: ArrayLike) -> Array:
    """Rotations (..., 3, 3) about y, angle (...) in rad."""
    return _turns(angle, 2, 0)


def rotation_z(angle: ArrayLike) -> Array:
    """Rotations (..., 3, 3) about z, angle (...) in rad."""
    return _turns(angle, 0, 1)
