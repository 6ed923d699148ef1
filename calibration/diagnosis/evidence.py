"""What every suspected cause is tried on: robot poses, and where each image alone puts the target.

An image tells its target's pose to within a covariance of its own, so that a trial needs no pixels any more.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from calibration.linear_algebra import scaled_inverse
from calibration.observations.observations import Observations
from calibration.observations.reprojection import PixelStatistics, pixel_statistics
from calibration.problem import Problem, Setup, anchor_T_mount_of
from calibration.transforms import Array

SMALLEST_PIXEL = 1e-4
"""Pixels that fit better than this come from a simulation; the robot's error is what remains."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """n views, called by their `indices` (n,). `covariance` (n, 6, 6) of exp(.) @ camera_T_target, [rad, mm].

    `redundancy` (n,): how many pixel coordinates each view has beyond those its pose takes: its covariance is known so
    well.
    """

    setup: Setup
    indices: NDArray[np.intp]
    base_T_flange: Array
    camera_T_target: Array
    covariance: Array
    redundancy: Array

    def __len__(self) -> int:
        return len(self.indices)

    def take(self, chosen: NDArray[np.intp] | NDArray[np.bool_]) -> "Evidence":
        """Only the chosen views."""
        return Evidence(
            self.setup,
            self.indices[chosen],
            self.base_T_flange[chosen],
            self.camera_T_target[chosen],
            self.covariance[chosen],
            self.redundancy[chosen],
        )

    def with_robot_poses(self, base_T_flange: Array) -> "Evidence":
        """The same images at other robot poses (n, 4, 4)."""
        return replace(self, base_T_flange=base_T_flange)

    def with_camera_poses(self, camera_T_target: Array) -> "Evidence":
        """The same robot poses with other poses (n, 4, 4) from the images."""
        return replace(self, camera_T_target=camera_T_target)

    def anchor_T_mount(self) -> Array:
        """(n, 4, 4), see `calibration.problem`."""
        return anchor_T_mount_of(self.setup, self.base_T_flange)

    def scaled(self, factor: float) -> "Evidence":
        """As if the target were `factor` times as large."""
        grow = np.repeat([1.0, factor], 3)
        camera_T_target = self.camera_T_target.copy()
        camera_T_target[:, :3, 3] *= factor
        return replace(self, camera_T_target=camera_T_target, covariance=grow[:, None] * self.covariance * grow)


def evidence_of(problem: Problem, seen: Observations, camera: CameraModel, camera_T_target: Array) -> Evidence:
    """From corners and each view's own pose (n, 4, 4); the pixel noise is what those poses leave."""
    statistics = pixel_statistics(seen, camera, camera_T_target)
    pixel = pixel_deviation(statistics)
    covariance = pixel**2 * scaled_inverse(statistics.normal)
    indices = np.array([problem.views[position].index for position in seen.positions], np.intp)
    redundancy = np.maximum(statistics.count - 6.0, 1.0)
    return Evidence(problem.setup, indices, seen.base_T_flange, camera_T_target, covariance, redundancy)


def pixel_deviation(statistics: PixelStatistics) -> float:
    """One standard deviation of a pixel coordinate, from what each view's own pose leaves."""
    redundancy = max(float(statistics.count.sum()) - 6 * len(statistics.count), 1.0)
    return max(float(np.sqrt(statistics.square.sum() / redundancy)), SMALLEST_PIXEL)
