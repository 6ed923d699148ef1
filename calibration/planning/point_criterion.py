"""The criterion of planning: the variance of the worst of the points that matter."""

import numpy as np

from calibration.likelihood.mapped_points import camera_points_mm, point_rows
from calibration.likelihood.predicted_uncertainty import Scene, working_points_mm
from calibration.problem import anchor_T_mount_of
from calibration.transforms import Array


def point_matrices(scene: Scene, distance_mm: float, base_T_flange: Array) -> Array:
    """W (n, 6, 6), one for each of the points that matter: trace(W cov) is its variance in mm².

    Without points of the user's: the working volume at `distance_mm`. A point of the base seen by a camera on the
    flange is averaged over the poses (m, 4, 4) that have it in the image.
    """
    if not scene.points:
        rows = point_rows(working_points_mm(scene.camera, distance_mm))
        return np.swapaxes(rows, 1, 2) @ rows
    anchor_T_mount = anchor_T_mount_of(scene.setup, base_T_flange)
    matrices = []
    for point in scene.points:
        rows = point_rows(camera_points_mm(point, scene.setup, scene.mount_T_camera, anchor_T_mount, scene.camera))
        matrices.append((np.swapaxes(rows, 1, 2) @ rows).mean(axis=0))
    return np.array(matrices)


def worst_variances(matrices: Array, covariance: Array) -> Array:
    """Variance (n,) of the worst point, in mm², of covariances (n, 6, 6); infinite where X is not determined."""
    with np.errstate(invalid="ignore"):
        variances = np.einsum("pij,nji->np", matrices, covariance, optimize=True)
    return np.where(np.all(np.isfinite(variances), axis=1), variances.max(axis=1), np.inf)
