"""M. Shah, "Solving the robot-world/hand-eye calibration problem using the Kronecker product", JMR 5(3), 2013.

A X = Y B with A = anchor_T_mount, X = mount_T_camera, Y = anchor_T_target, B = target_T_camera.
"""

import numpy as np

from calibration.closed_forms.kronecker import as_rotation, kronecker_sum
from calibration.transforms import Array, inverse, transform


def shah(anchor_T_mount: Array, camera_T_target: Array) -> Array:
    """X (4, 4): both rotations from the first singular vectors (Eqs. 22 to 24), both translations linearly (Eq. 30)."""
    u, _, vt = np.linalg.svd(kronecker_sum(anchor_T_mount[:, :3, :3], camera_T_target[:, :3, :3]))
    mount_R_camera, anchor_R_target = as_rotation(np.stack([vt[0].reshape(3, 3), u[:, 0].reshape(3, 3)]))
    n = len(anchor_T_mount)
    coefficients = np.concatenate([anchor_T_mount[:, :3, :3], np.broadcast_to(-np.eye(3), (n, 3, 3))], axis=2)
    target_t_camera = inverse(camera_T_target)[:, :3, 3]
    right_hand = target_t_camera @ anchor_R_target.T - anchor_T_mount[:, :3, 3]
    translation = np.linalg.lstsq(coefficients.reshape(-1, 6), right_hand.reshape(-1), rcond=None)[0][:3]
    return transform(mount_R_camera, translation)
