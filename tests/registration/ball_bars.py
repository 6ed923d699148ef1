"""Clouds of a ball bar, with the scanner's errors known."""

import numpy as np

from calibration.transforms import Array

RADIUS_MM, SPACING_MM = 20.0, 150.0


def ball(centre: Array, seed: int, *, noise_mm: float = 0.0, larger_mm: float = 0.0) -> Array:
    """The half towards the scanner at the origin."""
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(8000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals[normals @ centre < 0]
    return centre + normals * (RADIUS_MM + larger_mm + rng.normal(0, noise_mm, (len(normals), 1)))


def bar(seed: int, *, longer_mm: float = 0.0, **errors: float) -> Array:
    along = np.random.default_rng(seed).normal(size=3)
    along /= np.linalg.norm(along)
    middle = np.array([10.0 * seed, -5.0 * seed, 600.0])
    half = along * (SPACING_MM + longer_mm) / 2
    return np.concatenate([ball(middle - half, seed, **errors), ball(middle + half, seed + 100, **errors)])
