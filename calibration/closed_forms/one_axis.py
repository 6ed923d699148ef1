"""X from turns about one axis and travel across it, for arms that cannot tilt; its coordinate along the axis is 0.

The turns give the axis in the camera. X's rotation about it and its translation across it follow from
(R_A - I) t = R_X t_B - t_A (Tsai & Lenz 1989, Eq. 15), whose components across the axis are linear in t, and in the
cosine and sine of that rotation.
"""

import numpy as np

from calibration.closed_forms.motions import all_pairs
from calibration.transforms import Array, rotation_from_vector, skew, transform


def one_axis(anchor_T_mount: Array, camera_T_target: Array, axis_mount: Array) -> Array:
    """X (4, 4) from poses (n, 4, 4) whose turns are about `axis_mount` (3,)."""
    motions = all_pairs(anchor_T_mount, camera_T_target)
    turns_mount, turns_camera = motions.vectors()
    in_camera = (turns_mount @ axis_mount) @ turns_camera
    first = _least_turn(in_camera / np.linalg.norm(in_camera), axis_mount)
    across = np.linalg.svd(axis_mount[None])[2][1:]
    moved = motions.camera[:, :3, 3] @ first.T
    design = np.concatenate(
        [
            across @ (motions.mount[:, :3, :3] - np.eye(3)) @ across.T,
            -(moved @ across.T)[:, :, None],
            -(moved @ skew(axis_mount).T @ across.T)[:, :, None],
        ],
        axis=2,
    ).reshape(-1, 4)
    found = np.linalg.lstsq(design, -(motions.mount[:, :3, 3] @ across.T).ravel(), rcond=None)[0]
    length = float(np.hypot(found[2], found[3]))
    about = rotation_from_vector(float(np.arctan2(found[3], found[2])) * axis_mount)
    return transform(about @ first, across.T @ found[:2] / max(length, 1e-12))


def _least_turn(a: Array, b: Array) -> Array:
    """The rotation (3, 3) by the least angle that brings the direction a (3,) to b."""
    cross = np.cross(a, b)
    sine = float(np.linalg.norm(cross))
    if sine < 1e-9:  # parallel, or opposite: half a turn about anything across
        return np.eye(3) if a @ b > 0 else rotation_from_vector(np.pi * np.linalg.svd(a[None])[2][1])
    return rotation_from_vector(cross / sine * float(np.arctan2(sine, a @ b)))
