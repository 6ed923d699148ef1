"""Evidence on which hypotheses are tested: robot poses, and the target's pose of each image with its covariance.

The covariances replace the pixels, so that a test is quick.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from calibration.linear_algebra import scaled_inverse, scaled_solve
from calibration.observations.observations import Observations
from calibration.observations.reprojection import PixelStatistics, pixel_statistics
from calibration.observations.view_poses import refine_poses
from calibration.problem import Problem, Setup, anchor_T_mount_of
from calibration.transforms import Array, rotation_from_vector, transform

MIN_PIXEL_SIGMA = 1e-4
"""Floor of the pixel noise, px; only simulated pixels fit better."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """n views with their `indices` (n,) in the session.

    base_T_flange, camera_T_target : (n, 4, 4).
    covariance : (n, 6, 6) of exp(.) @ camera_T_target, [rad, mm].
    redundancy : (n,) pixel coordinates less the six parameters of a pose: degrees of freedom of the covariance.
    joints_rad : (n, axes) as the robot reported them; None where they were not recorded with every view.
    by_camera : (n, 6, k) change of the poses by each of k independent errors of an estimated camera, one standard
        deviation each; all views share them. None where the camera was given.
    pictures : the corners themselves, None where the poses are not of pictures.
    """

    setup: Setup
    indices: NDArray[np.intp]
    base_T_flange: Array
    camera_T_target: Array
    covariance: Array
    redundancy: Array
    joints_rad: Array | None = None
    by_camera: Array | None = None
    pictures: "Pictures | None" = None

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
            None if self.joints_rad is None else self.joints_rad[chosen],
            None if self.by_camera is None else self.by_camera[chosen],
            self.pictures,
        )

    def with_robot_poses(self, base_T_flange: Array) -> "Evidence":
        """The same images at other robot poses (n, 4, 4)."""
        return replace(self, base_T_flange=base_T_flange)

    def with_camera_poses(self, camera_T_target: Array) -> "Evidence":
        """The same robot poses with other poses (n, 4, 4) from the images."""
        return replace(self, camera_T_target=camera_T_target)

    def with_images(self, camera_T_target: Array, covariance: Array) -> "Evidence":
        """The same robot poses with other poses (n, 4, 4) from the images and their covariances (n, 6, 6)."""
        return replace(self, camera_T_target=camera_T_target, covariance=covariance)

    def anchor_T_mount(self) -> Array:
        """(n, 4, 4), see `calibration.problem`."""
        return anchor_T_mount_of(self.setup, self.base_T_flange)

    def scale_target(self, factor: float) -> "Evidence":
        """The evidence of a target `factor` times as large."""
        grow = np.repeat([1.0, factor], 3)
        camera_T_target = self.camera_T_target.copy()
        camera_T_target[:, :3, 3] *= factor
        by_camera = None if self.by_camera is None else grow[:, None] * self.by_camera
        covariance = grow[:, None] * self.covariance * grow
        return replace(self, camera_T_target=camera_T_target, covariance=covariance, by_camera=by_camera)


@dataclass(frozen=True, eq=False)
class Pictures:
    """The corners of views by their index in the session, the camera, and one standard deviation of a pixel."""

    rows: Mapping[int, int]
    seen: Observations
    camera: CameraModel
    image_size: tuple[int, int]
    pixel_px: float

    def corners(self, evidence: Evidence) -> Observations:
        """The corners of the views of `evidence`."""
        return self.seen.take(np.array([self.rows[index] for index in evidence.indices.tolist()], np.intp))

    def turned(self, evidence: Evidence, angle_rad: float) -> tuple[Array, Array]:
        """Poses (n, 4, 4) and covariances (n, 6, 6) of the views of `evidence` with their pictures turned about the
        middle, which is not the principal point."""
        seen = turn_pictures(self.corners(evidence), self.image_size, angle_rad)
        turn = rotation_from_vector(np.array([0.0, 0.0, angle_rad]))
        poses = refine_poses(seen, self.camera, transform(turn, np.zeros(3)) @ evidence.camera_T_target)
        return poses, self.pixel_px**2 * scaled_inverse(pixel_statistics(seen, self.camera, poses).normal)


def turn_pictures(seen: Observations, image_size: tuple[int, int], angle_rad: float) -> Observations:
    """The corners in pictures of that size (width, height) turned about their middle."""
    turn = rotation_from_vector(np.array([0.0, 0.0, angle_rad]))[:2, :2]
    middle_px = (np.array(image_size) - 1) / 2
    return replace(seen, pixels=middle_px + (seen.pixels - middle_px) @ turn.T)


def evidence_of(
    problem: Problem,
    seen: Observations,
    camera: CameraModel,
    camera_T_target: Array,
    camera_covariance: Array | None = None,
) -> Evidence:
    """The evidence of corners and each view's own pose (n, 4, 4), with the pixel noise from their residuals.

    `camera_covariance`: see `PreparedSession`.
    """
    statistics = pixel_statistics(seen, camera, camera_T_target)
    pixel = pixel_deviation(statistics)
    covariance = pixel**2 * scaled_inverse(statistics.normal)
    indices = np.array([problem.views[position].index for position in seen.positions], np.intp)
    redundancy = np.maximum(statistics.count - 6.0, 1.0)
    rows = {index: row for row, index in enumerate(indices.tolist())}
    return Evidence(
        problem.setup,
        indices,
        seen.base_T_flange,
        camera_T_target,
        covariance,
        redundancy,
        recorded_joints(problem, seen.positions),
        None if camera_covariance is None else _by_camera(seen, camera, camera_T_target, camera_covariance),
        pictures=Pictures(rows, seen, camera, problem.image_size, pixel),
    )


def _by_camera(seen: Observations, camera: CameraModel, camera_T_target: Array, covariance: Array) -> Array:
    """`Evidence.by_camera`: each view's pose follows the intrinsics so that its corners fit."""
    free = np.diagonal(covariance) > 0
    variances, directions = np.linalg.eigh(covariance[np.ix_(free, free)])
    errors = directions * np.sqrt(np.maximum(variances, 0.0))
    normal = pixel_statistics(seen, camera, camera_T_target, free_intrinsics=free).normal
    by_camera: Array = -scaled_solve(normal[:, :6, :6], normal[:, :6, 6:] @ errors)
    return by_camera


def recorded_joints(problem: Problem, positions: NDArray[np.intp]) -> Array | None:
    """Joints (n, axes) of the views at `positions` (n,), rad; None where not every view has them."""
    joints = [joints for position in positions if (joints := problem.views[position].stance.joints_rad) is not None]
    return np.array(joints) if len(joints) == len(positions) and len({len(one) for one in joints}) == 1 else None


def pixel_deviation(statistics: PixelStatistics) -> float:
    """One standard deviation of a pixel coordinate, from the residuals of each view's own pose."""
    redundancy = max(float(statistics.count.sum()) - 6 * len(statistics.count), 1.0)
    return max(float(np.sqrt(statistics.square.sum() / redundancy)), MIN_PIXEL_SIGMA)
