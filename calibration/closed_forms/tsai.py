"""R. Tsai & R. Lenz, "A new technique for fully autonomous and efficient 3D robotics hand/eye calibration", T-RA 1989.

The rotation of X is found as P' = tan(theta / 2) times its axis, which is infinite at 180 degrees, a common mounting.
So the same equations are also solved with the camera's frame turned by 180 degrees about each of its axes (X turns by
at most 120 degrees in one of the four), and the solution that fits the rotations best is kept.
"""

import numpy as np

from calibration.closed_forms.motions import all_pairs, with_translation
from calibration.transforms import Array, skew

HALF_TURNS = (np.eye(3), np.diag([1.0, -1, -1]), np.diag([-1.0, 1, -1]), np.diag([-1.0, -1, 1]))


def tsai(anchor_T_mount: Array, camera_T_target: Array) -> Array:
    """X (4, 4), rotation and then translation."""
    motions = all_pairs(anchor_T_mount, camera_T_target).with_clear_axes()
    alpha, beta = motions.vectors()
    mount, camera = _modified_rodrigues(alpha), _modified_rodrigues(beta)
    # R carries the turned camera axes turn' k onto the mount's; X's rotation is R turn', and turn is symmetric.
    candidates = [_rotation(_half_tangent(mount, camera @ turn)) @ turn for turn in HALF_TURNS]
    rotation = min(candidates, key=lambda candidate: float(np.linalg.norm(alpha - beta @ candidate.T)))
    return with_translation(motions, rotation)


def _modified_rodrigues(vectors: Array) -> Array:
    """P = 2 sin(theta / 2) n of rotation vectors (k, 3) (Eq. 9)."""
    angle = np.linalg.norm(vectors, axis=1, keepdims=True)
    scaled: Array = 2 * np.sin(angle / 2) * vectors / angle
    return scaled


def _half_tangent(mount: Array, camera: Array) -> Array:
    """P' (3,) from skew(P_mount + P_camera) P' = P_camera - P_mount (Eq. 12)."""
    coefficients, right_hand = skew(mount + camera).reshape(-1, 3), (camera - mount).reshape(-1)
    return np.asarray(np.linalg.lstsq(coefficients, right_hand, rcond=None)[0])


def _rotation(half_tangent: Array) -> Array:
    """Rotation (3, 3) of P' by Eqs. 14 and 10."""
    p = 2 * half_tangent / np.sqrt(1 + half_tangent @ half_tangent)
    rotation: Array = (1 - p @ p / 2) * np.eye(3) + (np.outer(p, p) + np.sqrt(max(4 - float(p @ p), 0.0)) * skew(p)) / 2
    return rotation
