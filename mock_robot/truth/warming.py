"""A camera that warms up from picture to picture, while its image shifts on the sensor."""

from dataclasses import dataclass, replace
from math import exp

import numpy as np

from calibration.camera import CameraModel


@dataclass(frozen=True)
class CameraWarming:
    """From `cold_c` towards `warm_c`: after `pictures` of them 63 % of the way.

    `px_per_k`: shift of the image (u, v). `reported`: whether the camera gives its temperature with each picture.
    """

    cold_c: float = 32.0
    warm_c: float = 47.0
    pictures: float = 8.0
    px_per_k: tuple[float, float] = (0.1, -0.05)
    reported: bool = True

    def temperature_c(self, number: int) -> float:
        """While picture `number` is taken, the first one being 1."""
        return self.warm_c + (self.cold_c - self.warm_c) * exp(-(number - 1) / self.pictures)

    def camera(self, cold: CameraModel, number: int) -> CameraModel:
        """The camera that takes picture `number`."""
        matrix = cold.matrix.copy()
        matrix[:2, 2] += np.array(self.px_per_k) * (self.temperature_c(number) - self.cold_c)
        return replace(cold, matrix=matrix)
