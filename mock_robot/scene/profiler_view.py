"""Simulates the profiles of a laser triangulation sensor: a fan of light in its plane y = 0, z along it."""

from dataclasses import dataclass

import numpy as np

from calibration.transforms import Array
from mock_robot.scene.part import DOOR
from mock_robot.scene.scanner_view import ScannerModel, cast


@dataclass(frozen=True)
class ProfilerModel:
    """`columns` points across a fan of twice `half_angle_deg`, measured within `range_mm` of z with `noise_mm`."""

    columns: int = 320
    half_angle_deg: float = 15.0
    range_mm: tuple[float, float] = (300.0, 700.0)
    noise_mm: float = 0.04

    def slopes(self) -> Array:
        """x / z (columns,) of the light."""
        widest = float(np.tan(np.radians(self.half_angle_deg)))
        return np.linspace(-widest, widest, self.columns)

    def measured(self, z: Array, rng: np.random.Generator) -> tuple[Array, Array]:
        """x and z (n, columns) with noise, NaN out of range."""
        near, far = self.range_mm
        with np.errstate(invalid="ignore"):
            seen = np.where((z > near) & (z < far), z + rng.normal(0, self.noise_mm, z.shape), np.nan)
        return self.slopes() * seen, seen


def profile_door(profiler: ProfilerModel, part_T_profiler: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """x and z (n, columns) in mm of the door's skin from poses (n, 4, 4), NaN beside the metal."""
    slopes = profiler.slopes()
    length = np.hypot(slopes, 1.0)
    rays = np.column_stack([slopes, np.zeros_like(slopes), np.ones_like(slopes)]) / length[:, None]
    scanner = ScannerModel(range_mm=profiler.range_mm)
    z = np.array([cast(scanner, pose, rays, DOOR)[0] / length for pose in part_T_profiler])
    return profiler.measured(z, rng)
