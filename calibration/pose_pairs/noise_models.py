"""Noise models of pairs of poses: the robot's, and four kinds of camera.

A model consists of sources of error. Each source has one unknown level and, for each view, the directions (6, k) in
which it acts on the residual (`calibration.pose_pairs.residuals`).
"""

from collections.abc import Callable

import numpy as np

from calibration.pose_pairs.residuals import LinearisedPairs, PosePairs
from calibration.transforms import Array

Sources = dict[str, Array]
"""Directions (n, 6, k) by source."""


def robot_sources(at: LinearisedPairs) -> Sources:
    """Errors of the flange's pose in its own frame, and rotations of the whole arm about its base."""
    return {
        "robot rotation": at.by_flange[:, :, :3],
        "robot translation": at.by_flange[:, :, 3:],
        "arm": at.by_base[:, :, :3],
    }


def detection_sources(at: LinearisedPairs) -> Sources:
    """A target detected with errors of constant size: orientation, position across the line of sight and along it."""
    sight, across = _sight(at.predicted[:, :3, 3])
    return {
        "camera rotation": _turn(np.broadcast_to(np.eye(3), (len(sight), 3, 3))),
        "camera lateral": _shift(across) * at.scale,
        "camera depth": _shift(sight) * at.scale,
    }


def image_sources(at: LinearisedPairs) -> Sources:
    """A target detected in a noisy image: errors grow with the distance, that of the depth with its square.

    Tilt has its own level, separate from roll about the line of sight: a tilt moves an edge along the sight, where it
    shows less.
    """
    distance = np.linalg.norm(at.predicted[:, :3, 3], axis=1)
    ratio = (distance / max(float(distance.mean()), 1e-9))[:, None, None]
    sight, across = _sight(at.predicted[:, :3, 3])
    return {
        "camera rotation": _turn(across) * ratio,
        "camera roll": _turn(sight) * ratio,
        "camera lateral": _shift(across) * ratio * at.scale,
        "camera depth": _shift(sight) * ratio**2 * at.scale,
    }


def tracking_sources(at: LinearisedPairs) -> Sources:
    """A camera that tracks its own pose in its surroundings, with errors of constant size."""
    return {"camera rotation": at.by_camera[:, :, :3], "camera lateral": at.by_camera[:, :, 3:]}


CAMERAS: dict[str, Callable[[LinearisedPairs], Sources]] = {
    "detected": detection_sources,
    "imaged": image_sources,
    "tracked": tracking_sources,
}
GIVEN = "given"
"""A camera whose covariance is known and part of the residuals' floor: it has no sources of its own."""

RANDOM_WALK = "drifting"
"""As `tracking_sources`, with errors that add up from view to view: `calibration.pose_pairs.random_walk_noise`."""


def cameras_of(pairs: PosePairs) -> tuple[str, ...]:
    """The kinds of camera whose errors are independent. A given covariance may be too small: the others add to it."""
    return tuple(CAMERAS) if pairs.covariance is None else (GIVEN, *CAMERAS)


def sources_of(at: LinearisedPairs, camera: str) -> Sources:
    """The sources of robot and camera; of a RANDOM_WALK those of single views."""
    if camera == GIVEN:
        return robot_sources(at)
    model = tracking_sources if camera == RANDOM_WALK else CAMERAS[camera]
    sources = robot_sources(at) | model(at)
    if camera == RANDOM_WALK:
        del sources["arm"]
    return sources


def _sight(translation: Array) -> tuple[Array, Array]:
    """Unit vectors (n, 3, 1) along and (n, 3, 2) across the line of sight; the optical axis where there is none."""
    distance = np.linalg.norm(translation, axis=1, keepdims=True)
    along = np.where(distance > 1e-9, translation / np.maximum(distance, 1e-9), [0.0, 0.0, 1.0])
    frame = np.linalg.svd(along[:, :, None], full_matrices=True)[0]
    return along[:, :, None], frame[:, :, 1:]


def _turn(directions: Array) -> Array:
    return np.concatenate([directions, np.zeros_like(directions)], axis=1)


def _shift(directions: Array) -> Array:
    return np.concatenate([np.zeros_like(directions), directions], axis=1)
