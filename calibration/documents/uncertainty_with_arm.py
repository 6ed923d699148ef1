"""The uncertainty of X that was identified together with the errors of the arm, as calibration.json states it."""

import numpy as np

from calibration.documents.calibration import CalibrationDocument, PointUncertaintyDocument, UncertaintyDocument
from calibration.kinematics.arm_estimate import ArmEstimate
from calibration.likelihood.mapped_points import WORKING_VOLUME_NAMES, point_sigmas_mm
from calibration.likelihood.predicted_uncertainty import uncertainty_of, working_points_mm
from calibration.solution import COVERAGE_FACTOR
from calibration.solver.registered_points import point_variances
from calibration.transforms import Array


def uncertainty_with_arm(
    document: CalibrationDocument, estimate: ArmEstimate, joints_rad: Array
) -> UncertaintyDocument | None:
    """In place of the document's: of X by the joint estimate, and of points by X and the arm at joints (n, 6).

    A point that matters keeps its place before the camera, and has the largest of its uncertainties at the joints.
    """
    claimed = document.uncertainty
    if claimed is None:
        return None
    covariance = estimate.covariance[:6, :6]
    listed = np.array([point.camera_mm for point in claimed.points]).reshape(-1, 3)
    volume = working_volume_mm(document)
    sigmas = _sigmas_mm(document, estimate, joints_rad, np.concatenate([listed, volume]))
    of_x = uncertainty_of(covariance, estimate.mount_T_camera, volume)
    x, y, z = of_x.translation_mm.tolist()
    a, b, c = np.degrees(of_x.rotation_rad).tolist()
    points = [_at(point, float(sigma)) for point, sigma in zip(claimed.points, sigmas.max(axis=0), strict=False)]
    return claimed.model_copy(
        update={
            "translation_mm": (x, y, z),
            "rotation_deg": (a, b, c),
            "point_mm": float(np.sqrt(np.mean(sigmas[:, len(listed) :] ** 2))),
            "covariance": tuple(map(tuple, covariance.tolist())),
            "points": tuple(points),
            "leave_out": None,
        }
    )


def working_volume_mm(document: CalibrationDocument) -> Array:
    """The points (n, 3) of the camera's frame at which `point_mm` is taken; the camera's origin where none is known."""
    points = () if document.uncertainty is None else document.uncertainty.points
    if not points:
        return np.zeros((1, 3))
    listed = np.array([point.camera_mm for point in points])
    if document.camera is None or {point.name for point in points} <= set(WORKING_VOLUME_NAMES):
        return listed
    return working_points_mm(document.camera.camera(), float(np.median(np.linalg.norm(listed, axis=1))))


def _sigmas_mm(document: CalibrationDocument, estimate: ArmEstimate, joints_rad: Array, points_mm: Array) -> Array:
    """Standard deviations (n, m) at the joints; of a camera beside the robot (1, m), in the base, by X alone."""
    if document.setup == "eye-to-hand":
        return point_sigmas_mm(estimate.covariance[:6, :6], points_mm)[None]
    return np.asarray(np.sqrt(point_variances(estimate, joints_rad, points_mm)))


def _at(point: PointUncertaintyDocument, sigma_mm: float) -> PointUncertaintyDocument:
    return point.model_copy(update={"sigma_mm": sigma_mm, "expanded_mm": COVERAGE_FACTOR * sigma_mm})
