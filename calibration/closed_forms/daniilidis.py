"""K. Daniilidis, "Hand-eye calibration using dual quaternions", Int. J. Robotics Research 18(3), 1999."""

import numpy as np

from calibration.closed_forms.motions import MotionPairs, all_pairs
from calibration.closed_forms.quaternions import left_product_matrix
from calibration.transforms import Array, quaternion_from_rotation, rotation_from_quaternion, skew, transform


def daniilidis(anchor_T_mount: Array, camera_T_target: Array) -> Array:
    """X (4, 4), rotation and translation at once as a unit dual quaternion."""
    motions = all_pairs(anchor_T_mount, camera_T_target).with_clear_axes()
    real, dual = _from_null_space(np.linalg.svd(_equations(motions), full_matrices=False)[2])
    rotation = rotation_from_quaternion(real)
    # t = 2 q' conj(q): the vector part of the product (Eq. 12).
    translation = 2 * (real[0] * dual[1:] - dual[0] * real[1:] + np.cross(real[1:], dual[1:]))
    return transform(rotation, translation)


def _equations(motions: MotionPairs) -> Array:
    """T (6k, 8) of Eqs. 31 and 33, with lengths scaled so that rotation and translation weigh alike."""
    a, a_dual = _dual_quaternions(motions.mount)
    b, b_dual = _dual_quaternions(motions.camera)
    k = len(a)
    rows = np.zeros((max(k, 2), 6, 8))  # at least as many rows as unknowns, for both vectors of the null space
    rows[:k, :3, 0] = rows[:k, 3:, 4] = (a - b)[:, 1:]
    rows[:k, :3, 1:4] = rows[:k, 3:, 5:] = skew((a + b)[:, 1:])
    rows[:k, 3:, 0] = (a_dual - b_dual)[:, 1:]
    rows[:k, 3:, 1:4] = skew((a_dual + b_dual)[:, 1:])
    return rows.reshape(-1, 8)


def _dual_quaternions(motions: Array) -> tuple[Array, Array]:
    """q and q' = t q / 2 of transforms (k, 4, 4), with q's scalar part not negative (Eq. 9)."""
    real = quaternion_from_rotation(motions[:, :3, :3])
    pure = np.concatenate([np.zeros((len(motions), 1)), motions[:, :3, 3]], axis=1)
    return real, (left_product_matrix(pure) @ real[..., None])[..., 0] / 2


def _from_null_space(vt: Array) -> tuple[Array, Array]:
    """The combination of the last two right singular vectors that is a unit dual quaternion (Eqs. 34 and 35)."""
    (u1, v1), (u2, v2) = vt[6].reshape(2, 4), vt[7].reshape(2, 4)
    coefficients = np.array([u1 @ v1, u1 @ v2 + u2 @ v1, u2 @ v2])
    if abs(coefficients[0]) > 1e-12 * np.abs(coefficients).max(initial=1e-300):
        root = np.sqrt(max(coefficients[1] ** 2 - 4 * coefficients[0] * coefficients[2], 0.0))
        ratios = (-coefficients[1] + np.array([root, -root])) / (2 * coefficients[0])
        pairs = [(ratio, 1.0) for ratio in ratios]
    else:
        pairs = [(1.0, 0.0), (-coefficients[2] / coefficients[1], 1.0) if coefficients[1] else (0.0, 1.0)]
    # Of the two roots, the one whose real part is longer.
    first, second = max(pairs, key=lambda pair: float(np.linalg.norm(pair[0] * u1 + pair[1] * u2) / np.hypot(*pair)))
    real, dual = first * u1 + second * u2, first * v1 + second * v2
    length = np.linalg.norm(real)
    return real / length, dual / length
