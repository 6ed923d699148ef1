"""The covariance of X in the words of the documents."""

import numpy as np

from calibration.camera import CameraModel
from calibration.likelihood.predicted_uncertainty import point_weights, working_points_mm
from calibration.solution import Uncertainty
from calibration.transforms import Array


def uncertainty_of(
    covariance: Array, mount_T_camera: Array, camera: CameraModel, target_distance_mm: float
) -> Uncertainty:
    """From the covariance (6, 6) of [rotation rad, translation mm] of mount_T_camera @ exp(.)."""
    mount_R_camera = mount_T_camera[:3, :3]
    translation = np.diagonal(mount_R_camera @ covariance[3:, 3:] @ mount_R_camera.T)
    weights = point_weights(working_points_mm(camera, target_distance_mm))
    return Uncertainty(
        translation_mm=np.sqrt(translation),
        rotation_rad=np.sqrt(np.diagonal(covariance)[:3]),
        point_mm=float(np.sqrt(np.sum(weights * covariance))),
        covariance=covariance,
    )
