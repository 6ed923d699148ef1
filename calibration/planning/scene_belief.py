"""What could as well be true: a pose that is uncertain, at the ends of its uncertainty."""

import numpy as np

from calibration.transforms import Array, rotation_from_vector, transform

SIGMAS = 2.0

LEVER_MM = 600.0
"""A radian counts as this many millimetres when the directions of greatest doubt are looked for."""

LEAST_RAD, LEAST_MM = np.radians(0.1), 1.0
"""Nothing is believed to be better known than this, however well the views agree."""


def alternatives(a_T_b: Array, covariance: Array) -> list[Array]:
    """Twelve poses (4, 4) at `SIGMAS` along the principal axes of `covariance` (6, 6) of [rad, mm], a_T_b @ exp(.)."""
    scale = np.repeat([LEVER_MM, 1.0], 3)
    floor = np.diag(np.repeat([LEAST_RAD**2, LEAST_MM**2], 3))
    values, axes = np.linalg.eigh((covariance + floor) * np.outer(scale, scale))
    steps = SIGMAS * np.sqrt(values)[:, None] * axes.T / scale
    return [a_T_b @ transform(rotation_from_vector(step[:3]), step[3:]) for step in np.concatenate([steps, -steps])]
