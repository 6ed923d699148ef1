"""What may be wrong with a pair of poses: the robot in every case, and four kinds of camera.

A model names sources of error. Each source has one unknown level and, per view, the directions (6, k) in which it acts
on the residual (`calibration.pose_pairs.residuals`).
"""

from collections.abc import Callable

import numpy as np

from calibration.pose_pairs.residuals import Linearised
from calibration.transforms import Array

Sources = dict[str, Array]
"""Directions (n, 6, k) by source."""


def robot(at: Linearised) -> Sources:
    """Errors of the flange's pose in its own frame, and turns of the whole arm about its base."""
    return {
        "robot rotation": at.by_flange[:, :, :3],
        "robot translation": at.by_flange[:, :, 3:],
        "arm": at.by_base[:, :, :3],
    }


def detected(at: Linearised) -> Sources:
    """A target seen with errors of one size: its turn, its place across the line of sight and along it."""
    sight, across = _sight(at.predicted[:, :3, 3])
    return {
        "camera rotation": _turn(np.broadcast_to(np.eye(3), (len(sight), 3, 3))),
        "camera lateral": _shift(across) * at.scale,
        "camera depth": _shift(sight) * at.scale,
    }


def imaged(at: Linearised) -> Sources:
    """A target of which the image is noisy: errors grow with the distance, that of the depth with its square.

    Tilts show less than turns about the line of sight: an edge moved by a tilt moves along the sight.
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


def tracked(at: Linearised) -> Sources:
    """A camera that knows its own pose in its surroundings, with errors of one size."""
    return {"camera rotation": at.by_camera[:, :, :3], "camera lateral": at.by_camera[:, :, 3:]}


CAMERAS: dict[str, Callable[[Linearised], Sources]] = {"detected": detected, "imaged": imaged, "tracked": tracked}
DRIFTING = "drifting"
"""As `tracked`, with errors that add up from view to view: `calibration.pose_pairs.random_walk_noise`."""


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
