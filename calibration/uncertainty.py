"""The covariance of X in the words of the documents."""

import numpy as np

from calibration.camera import CameraModel
from calibration.likelihood.estimate import Estimate
from calibration.likelihood.few_views import MOST_VIEWS
from calibration.likelihood.mixed_model import Variances, solve
from calibration.prediction import point_weights, working_points_mm
from calibration.solution import Uncertainty
from calibration.transforms import Array


def honest_covariance(best: Estimate) -> Array:
    """Covariance (6, 6) of X [rotation rad, translation mm], widened because the noise itself is only estimated.

    Errors scaled by an estimate from r observations follow Student's t, whose variance is r / (r - 2) times larger;
    only the part that comes from the robot is widened, the pixels being many. Few views have been averaged already.
    """
    covariance = best.step.covariance[:6, :6]
    views = len(best.model.count)
    if views <= MOST_VIEWS:
        return covariance
    observations = 3.0 * views - 6.0  # six numbers a view less twelve unknowns, shared by two levels
    exact_robot = Variances(best.variances.pixel, 0.0, 0.0)
    by_pixels = solve(best.model, exact_robot).covariance[:6, :6]
    return by_pixels + (covariance - by_pixels) * observations / (observations - 2)


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
