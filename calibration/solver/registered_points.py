"""Points registered through X and the built arm, with the uncertainty that both leave at a pose."""

import numpy as np

from calibration.kinematics.arm_errors import Postures
from calibration.kinematics.arm_estimate import ArmEstimate
from calibration.likelihood.mapped_points import point_rows
from calibration.transforms import Array, map_points


def registered_points(estimate: ArmEstimate, postures: Postures, points_mm: Array) -> tuple[Array, Array]:
    """Points (n, 3) of the camera's frame in the base, one at each posture, and their covariances (n, 3, 3), mm².

    For a camera on the flange. Not contained: by what the arm scatters about one pose.
    """
    flange, x = estimate.model.forward(estimate.parameters, postures), estimate.mount_T_camera
    on_flange = map_points(x, points_mm)
    base_R_flange = flange[:, :3, :3]
    by_x = base_R_flange @ x[:3, :3] @ point_rows(points_mm)
    by_arm = base_R_flange @ point_rows(on_flange) @ estimate.model.jacobian(estimate.parameters, postures)
    rows = np.concatenate([by_x, by_arm], axis=-1)
    covariance: Array = rows @ estimate.covariance @ np.swapaxes(rows, 1, 2)
    return map_points(flange, on_flange[:, None])[:, 0], covariance
