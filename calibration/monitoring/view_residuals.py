"""Where a calibration predicts the target's points in the picture of a view, from the robot's pose."""

import numpy as np

from calibration.documents.calibration import TRANSFORM_NAMES, CalibrationDocument, CorrectionDocument
from calibration.observations.pose_model import predicted_camera_T_target
from calibration.problem import anchor_T_mount_of
from calibration.targets import Target
from calibration.transforms import Array, map_points, transform_from_vector


def predict_pixels(
    document: CalibrationDocument,
    target: Target,
    base_T_flange: Array,
    correction: CorrectionDocument | None = None,
) -> Array | None:
    """Pixels (n, 2) of the target's points in a view from `base_T_flange` (4, 4); NaN behind the camera.

    `correction`: the error that the calibration estimates of this robot pose. None where the calibration has no
    transform or no camera.
    """
    poses = [getattr(document, name) for name in TRANSFORM_NAMES[document.setup]]
    if None in poses or document.camera is None:
        return None
    mount, anchor = (pose.transform() for pose in poses)
    if correction is not None:
        turn = np.radians(correction.rotation_deg)
        base_T_flange = base_T_flange @ transform_from_vector(np.concatenate([turn, correction.translation_mm]))
    anchor_T_mount = anchor_T_mount_of(document.setup, base_T_flange)
    camera_T_target = predicted_camera_T_target(anchor_T_mount[None], mount, anchor)[0]
    points_mm = document.scale_of(target) * target.points_mm
    return document.camera.camera().project(map_points(camera_T_target, points_mm))


def root_mean_square(residuals_px: Array) -> float | None:
    """RMS length of residuals (n, 2); None without any that is finite."""
    lengths = np.hypot(*residuals_px.T)
    lengths = lengths[np.isfinite(lengths)]
    return float(np.sqrt(np.mean(lengths**2))) if lengths.size else None
