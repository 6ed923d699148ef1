"""Where the target stood before the camera in every view, from that view's pixels alone."""

import cv2
import numpy as np

from calibration.camera import CameraModel
from calibration.likelihood.pixels import pixel_statistics
from calibration.observations import FEWEST_CORNERS, Observations
from calibration.transforms import Array, rotation_from_vector, transform


def moved(a_T_b: Array, step: Array) -> Array:
    """exp(step) @ a_T_b for steps (n, 6) of [rotation rad, translation mm]."""
    return transform(rotation_from_vector(step[:, :3]), step[:, 3:]) @ a_T_b


def candidate_poses(seen: Observations, camera: CameraModel) -> tuple[Array, Array]:
    """The two poses (n, 2, 4, 4) of camera_T_target that a plane allows, and their RMS errors (n, 2) in px.

    A pose that is out of the question is not refined.
    """
    xy = camera.normalise(seen.pixels.reshape(-1, 2)).reshape(seen.pixels.shape)
    poses = np.array([_both(seen, xy[row], row) for row in range(len(seen))]).reshape(-1, 2, 4, 4)
    errors = np.stack([_rms(seen, camera, poses[:, which]) for which in range(2)], axis=1)
    for which in range(2):
        rows = np.flatnonzero(errors[:, which] <= POSSIBLE * errors.min(axis=1) + POSSIBLE_PX)
        poses[rows, which] = refined_poses(seen.take(rows), camera, poses[rows, which])
        errors[rows, which] = _rms(seen.take(rows), camera, poses[rows, which])
    order = np.argsort(errors, axis=1)
    return np.take_along_axis(poses, order[:, :, None, None], axis=1), np.take_along_axis(errors, order, axis=1)


POSSIBLE, POSSIBLE_PX = 5.0, 3.0
"""A pose whose error before refinement is larger than this by the better one's stays the worse one."""


def _rms(seen: Observations, camera: CameraModel, poses: Array) -> Array:
    statistics = pixel_statistics(seen, camera, poses)
    rms: Array = np.sqrt(2 * statistics.square / statistics.count)
    return rms


NOWHERE = transform(np.eye(3), [0.0, 0.0, 1000.0])
"""Where a target stands whose corners no pose explains; its errors tell."""


def _both(seen: Observations, xy: Array, row: int) -> Array:
    """The two poses (2, 4, 4) by Collins & Bartoli's IPPE, from ideal coordinates xy (m, 2)."""
    used = (seen.weights[row] > 0) & np.all(np.isfinite(xy), axis=1)
    if np.count_nonzero(used) < FEWEST_CORNERS:
        return np.array([NOWHERE, NOWHERE])
    _, rotations, translations, _ = cv2.solvePnPGeneric(
        seen.points_mm[row, used], xy[used], np.eye(3), None, flags=cv2.SOLVEPNP_IPPE
    )
    poses = [
        transform(cv2.Rodrigues(rotation)[0], translation[:, 0])
        for rotation, translation in zip(rotations, translations, strict=True)
    ] or [NOWHERE]
    both: Array = np.nan_to_num(np.array([poses[0], poses[-1]]))
    return both


def refined_poses(seen: Observations, camera: CameraModel, camera_T_target: Array, iterations: int = 6) -> Array:
    """The poses (n, 4, 4) that minimise each view's reprojection error, by Gauss-Newton from the given ones."""
    for _ in range(iterations):
        statistics = pixel_statistics(seen, camera, camera_T_target)
        scale = 1 / np.sqrt(np.maximum(np.diagonal(statistics.normal, axis1=1, axis2=2), 1e-12))
        scaled = statistics.normal * scale[:, :, None] * scale[:, None, :] + 1e-10 * np.eye(6)
        step = -scale * np.linalg.solve(scaled, (scale * statistics.gradient)[..., None])[..., 0]
        camera_T_target = moved(camera_T_target, step)
        if np.max(np.abs(step), initial=0.0) < 1e-7:
            break
    return camera_T_target
