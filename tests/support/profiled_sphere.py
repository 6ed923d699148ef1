"""A sphere as a line profiler sees it."""

import numpy as np

from calibration.transforms import Array
from mock_robot.scene.scanner_view import ProfilerModel


def profile_sphere(
    profiler: ProfilerModel, profiler_T_base: Array, centre_mm: Array, radius_mm: float, rng: np.random.Generator
) -> tuple[Array, Array]:
    """x and z (n, columns) in mm of a sphere in base from poses (n, 4, 4), NaN beside it."""
    centre = profiler_T_base[:, :3, :3] @ centre_mm + profiler_T_base[:, :3, 3]
    slopes = profiler.slopes()
    square = 1 + slopes**2
    half = slopes * centre[:, :1] + centre[:, 2:]
    left = half**2 - square * (np.sum(centre**2, axis=1, keepdims=True) - radius_mm**2)
    with np.errstate(invalid="ignore"):
        return profiler.measured((half - np.sqrt(left)) / square, rng)
