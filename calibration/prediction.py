"""How well given poses will determine X, before anything has moved.

The maximum-likelihood estimate has the covariance of the Cramér-Rao bound, the inverse of the information

    F = sum_i  H_yy - H_ym (H_mm + S^-1)^-1 H_my        H = J' J / s_px²        y = (X, target's pose, [intrinsics])

where m is the robot's pose error in view i with prior covariance S, marginalised by its Schur complement.
Every perturbation is on the right, [rotation rad, translation mm]: T @ exp(.). Sources: Strobl & Hirzinger,
IROS 2006 (the model); Nahvi & Hollerbach, ICRA 1996 (the idea of choosing poses by it).
"""

from dataclasses import dataclass

import numpy as np

from calibration.camera import CameraModel
from calibration.problem import Setup
from calibration.targets import Target
from calibration.transforms import Array, inverse, map_points, skew

SMALLEST_DEVIATION = 1e-9
"""A noise-free robot is a very good one: keeps the information finite."""


@dataclass(frozen=True)
class ExpectedNoise:
    """One standard deviation per axis: pixels, robot rotation, robot translation."""

    image_px: float
    robot_rotation_rad: float
    robot_translation_mm: float


@dataclass(frozen=True, eq=False)
class Scene:
    """What is known, or guessed, before looking. Frames as in `calibration.problem`."""

    setup: Setup
    target: Target
    camera: CameraModel
    mount_T_camera: Array
    anchor_T_target: Array
    noise: ExpectedNoise
    intrinsics_free: bool = False

    def camera_T_target(self, base_T_flange: Array) -> Array:
        """(n, 4, 4) from robot poses (n, 4, 4)."""
        anchor_T_mount = base_T_flange if self.setup == "eye-in-hand" else inverse(base_T_flange)
        return inverse(anchor_T_mount @ self.mount_T_camera) @ self.anchor_T_target


@dataclass(frozen=True, eq=False)
class Prediction:
    """One standard deviation of X, (3,) each, and of a registered point; `covariance` (6, 6) of [rad, mm]."""

    covariance: Array
    rotation_rad: Array
    translation_mm: Array
    point_mm: float


def predict(scene: Scene, base_T_flange: Array) -> Prediction:
    """What views from the poses (n, 4, 4) will tell of X. Infinite where they do not determine it."""
    information = view_information(scene, base_T_flange).sum(axis=0)
    return prediction_of(scene, information, median_distance_mm(scene, base_T_flange))


def prediction_of(scene: Scene, information: Array, distance_mm: float) -> Prediction:
    """The prediction of a summed information matrix."""
    covariance = covariance_of(information)
    weights = point_weights(working_points_mm(scene.camera, distance_mm))
    deviations = np.sqrt(np.diagonal(covariance))
    return Prediction(
        covariance, deviations[:3], deviations[3:], float(np.sqrt(np.einsum("ij,ji->", weights, covariance)))
    )


def covariance_of(information: Array) -> Array:
    """Covariance (..., 6, 6) of X from information (..., k, k) on (X, rest); infinite where it is singular."""
    # Radians and millimetres differ by orders of magnitude: scale to unit diagonal before judging singularity.
    scale = 1 / np.sqrt(np.maximum(np.diagonal(information, axis1=-2, axis2=-1), 1e-300))
    scaled = information * scale[..., :, None] * scale[..., None, :]
    values, vectors = np.linalg.eigh(scaled)
    determined = values[..., 0] > 1e-13
    values = np.where(determined[..., None], values, 1.0)
    x_rows = vectors[..., :6, :] * scale[..., :6, None]
    covariance: Array = (x_rows / values[..., None, :]) @ np.swapaxes(x_rows, -1, -2)
    return np.where(determined[..., None, None], covariance, np.diag(np.full(6, np.inf)))


def view_information(scene: Scene, base_T_flange: Array) -> Array:
    """Information (n, k, k) that each view carries on (X, target's pose[, intrinsics]); k = 12 or 21."""
    camera_T_target = scene.camera_T_target(base_T_flange)
    pixels_by_view, pixels_by_camera = _pixel_jacobians(scene, camera_T_target)
    view_by_x = -adjoint(inverse(camera_T_target))
    view_by_robot = _view_by_robot(scene, base_T_flange)
    pixels_by_x = pixels_by_view @ view_by_x
    shared = [pixels_by_x, pixels_by_view] + ([pixels_by_camera] if scene.intrinsics_free else [])
    by_shared = np.concatenate(shared, axis=-1) / scene.noise.image_px
    by_robot = pixels_by_view @ view_by_robot / scene.noise.image_px
    prior = np.repeat([scene.noise.robot_rotation_rad, scene.noise.robot_translation_mm], 3)
    prior_information = np.diag(np.maximum(prior, SMALLEST_DEVIATION) ** -2)
    cross = np.swapaxes(by_shared, -1, -2) @ by_robot
    marginal = np.swapaxes(by_robot, -1, -2) @ by_robot + prior_information
    information: Array = np.swapaxes(by_shared, -1, -2) @ by_shared
    return information - cross @ np.linalg.solve(marginal, np.swapaxes(cross, -1, -2))


def adjoint(a_T_b: Array) -> Array:
    """(..., 6, 6): a_T_b @ exp(v) = exp(adjoint(a_T_b) @ v) @ a_T_b, for v = [rotation, translation]."""
    rotation = a_T_b[..., :3, :3]
    result = np.zeros((*a_T_b.shape[:-2], 6, 6))
    result[..., :3, :3] = result[..., 3:, 3:] = rotation
    result[..., 3:, :3] = skew(a_T_b[..., :3, 3]) @ rotation
    return result


def _view_by_robot(scene: Scene, base_T_flange: Array) -> Array:
    """How camera_T_target turns with the error of base_T_flange (n, 6, 6)."""
    if scene.setup == "eye-in-hand":
        return -adjoint(inverse(scene.anchor_T_target) @ base_T_flange)
    return adjoint(inverse(scene.anchor_T_target))[None].repeat(len(base_T_flange), axis=0)


def _pixel_jacobians(scene: Scene, camera_T_target: Array) -> tuple[Array, Array]:
    """d pixels by view (n, 2m, 6) and by intrinsics fx fy cx cy k1 k2 p1 p2 k3 (n, 2m, 9)."""
    points_target = scene.target.points_mm
    points = map_points(camera_T_target, points_target)
    n, m = points.shape[:2]
    flat = points.reshape(-1, 3)
    xy = flat[:, :2] / flat[:, 2:]
    fx, fy = scene.camera.matrix[0, 0], scene.camera.matrix[1, 1]
    by_xy = scene.camera.distortion_jacobian(xy) * np.array([fx, fy])[:, None]
    xy_by_point = np.zeros((n * m, 2, 3))
    xy_by_point[:, 0, 0] = xy_by_point[:, 1, 1] = 1 / flat[:, 2]
    xy_by_point[:, :, 2] = -xy / flat[:, 2:]
    point_by_view = np.concatenate([-skew(points_target), np.eye(3)[None].repeat(m, axis=0)], axis=-1)
    by_point = (by_xy @ xy_by_point).reshape(n, m, 2, 3) @ camera_T_target[:, None, :3, :3]
    by_view = (by_point @ point_by_view).reshape(n, 2 * m, 6)
    return by_view, _pixels_by_intrinsics(scene.camera, xy).reshape(n, 2 * m, 9)


def _pixels_by_intrinsics(camera: CameraModel, xy: Array) -> Array:
    """(n, 2, 9)"""
    fx, fy = camera.matrix[0, 0], camera.matrix[1, 1]
    x, y = xy.T
    r2 = x * x + y * y
    distorted = camera.distort(xy)
    result = np.zeros((len(xy), 2, 9))
    result[:, 0, 0], result[:, 1, 1] = distorted[:, 0], distorted[:, 1]
    result[:, 0, 2] = result[:, 1, 3] = 1.0
    result[:, 0, 4:] = fx * np.column_stack([x * r2, x * r2**2, 2 * x * y, r2 + 2 * x * x, x * r2**3])
    result[:, 1, 4:] = fy * np.column_stack([y * r2, y * r2**2, r2 + 2 * y * y, 2 * x * y, y * r2**3])
    return result


def median_distance_mm(scene: Scene, base_T_flange: Array) -> float:
    """Median distance from the camera to the middle of the target."""
    centre = scene.target.points_mm.mean(axis=0, keepdims=True)
    return float(np.median(np.linalg.norm(map_points(scene.camera_T_target(base_T_flange), centre), axis=-1)))


def working_points_mm(camera: CameraModel, distance_mm: float) -> Array:
    """The 27 points (27, 3) in the camera frame at which `point_mm` is taken.

    3×3 over the central 80 % of the image, at 0.9, 1.0 and 1.1 times the distance (along the optical axis).
    """
    width, height = camera.image_size
    u, v = np.meshgrid(np.array([0.1, 0.5, 0.9]) * (width - 1), np.array([0.1, 0.5, 0.9]) * (height - 1))
    rays = np.column_stack([camera.normalise(np.column_stack([u.ravel(), v.ravel()])), np.ones(9)])
    points: Array = (np.array([0.9, 1.0, 1.1])[:, None, None] * distance_mm * rays).reshape(-1, 3)
    return points


def point_weights(points_mm: Array) -> Array:
    """W (6, 6) with trace(W cov) = the mean variance of points (n, 3) mapped through X (covariance [rad, mm])."""
    by_x = np.concatenate([-skew(points_mm), np.eye(3)[None].repeat(len(points_mm), axis=0)], axis=-1)
    weights: Array = np.mean(np.swapaxes(by_x, -1, -2) @ by_x, axis=0)
    return weights
