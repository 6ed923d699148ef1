"""Points registered through X and the built arm, with the uncertainty that both leave at a pose."""

import numpy as np

from calibration.kinematics.arm_errors import AXES, Postures
from calibration.kinematics.arm_estimate import ArmEstimate
from calibration.kinematics.robot_accuracy import RobotNoise
from calibration.likelihood.mapped_points import point_rows
from calibration.transforms import Array, map_points

NO_SCATTER = RobotNoise(0.0, 0.0)


def registered_points(estimate: ArmEstimate, postures: Postures, points_mm: Array) -> tuple[Array, Array]:
    """Points (n, 3) of the camera's frame in the base, one at each posture, and their covariances (n, 3, 3), mm².

    For a camera on the flange. Not contained: by what the arm scatters about one pose.
    """
    flange = estimate.model.forward(estimate.parameters, postures)
    rows = flange[:, :3, :3] @ _rows(estimate, points_mm)
    on_flange = map_points(estimate.mount_T_camera, points_mm)
    covariance: Array = rows @ _pose_covariances(estimate, postures) @ np.swapaxes(rows, 1, 2)
    return map_points(flange, on_flange[:, None])[:, 0], covariance


def point_variances(
    estimate: ArmEstimate, joints_rad: Array, points_mm: Array, scatter: RobotNoise = NO_SCATTER
) -> Array:
    """Variances (n, m), mm², over three axes, of points (m, 3) of the camera's frame placed at each of the joints.

    They contain by what the arm scatters about one pose, and what is not known of it: the side of its play, and its
    temperature by `warmth_sigma_k`.
    """
    covariances, rows = _pose_covariances(estimate, estimate.postures(joints_rad)), _rows(estimate, points_mm)
    covariances[:, 6:, 6:] += unknown_covariances(estimate, joints_rad) + np.diag(np.repeat(scatter.levels() ** 2, 3))
    variances: Array = np.einsum("mij,njk,mik->nm", rows, covariances, rows, optimize=True)
    return variances


def _rows(estimate: ArmEstimate, points_mm: Array) -> Array:
    """Derivative (n, 3, 12) of points (n, 3), in the flange's axes, by X and the flange's pose, each times exp(.)."""
    x = estimate.mount_T_camera
    return np.concatenate([x[:3, :3] @ point_rows(points_mm), point_rows(map_points(x, points_mm))], axis=-1)


def _pose_covariances(estimate: ArmEstimate, postures: Postures) -> Array:
    """Covariance (n, 12, 12) of [X, the flange's pose at each posture], as rotation rad and translation mm each."""
    jacobian = estimate.model.jacobian(estimate.parameters, postures)
    by = np.zeros((len(postures), 12, len(estimate.covariance)))
    by[:, :6, :6] = np.eye(6)
    by[:, 6:, 6:] = jacobian
    covariances: Array = by @ estimate.covariance @ np.swapaxes(by, 1, 2)
    return covariances


def unknown_covariances(estimate: ArmEstimate, joints_rad: Array) -> Array:
    """Covariances (n, 6, 6) of the flange's pose, times exp(.), by what is not known of a standstill at joints (n, 6).

    These are the sides from which the axes came, and the arm's temperature by `warmth_sigma_k`.
    """
    unknown, n = estimate.model.indices("play", "warmth"), len(joints_rad)
    from_below = Postures(joints_rad, estimate.load, np.ones((n, AXES)), np.full(n, estimate.warmth_sigma_k))
    by_unknown = estimate.model.jacobian(estimate.parameters, from_below)[:, :, unknown]
    squares = estimate.parameters[unknown] ** 2 + np.diagonal(estimate.covariance)[6 + unknown]
    found: Array = (by_unknown * squares) @ np.swapaxes(by_unknown, 1, 2)
    return found
