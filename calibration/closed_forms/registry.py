"""Closed forms by name."""

from collections.abc import Callable

import numpy as np

from calibration.closed_forms.kronecker import as_rotation, kronecker, kronecker_sum
from calibration.closed_forms.motions import MotionPairs, all_pairs, with_translation
from calibration.closed_forms.three_pose import three_pose
from calibration.transforms import (
    Array,
    inverse,
    nearest_rotation,
    quaternion_from_rotation,
    rotation_from_quaternion,
    skew,
    transform,
)

# R. Horaud & F. Dornaika, "Hand-eye calibration", Int. J. Robotics Research 14(3), 1995.


def horaud(anchor_T_mount: Array, camera_T_target: Array) -> Array:
    """X (4, 4): the unit quaternion q with the least sum |n_A q - q n_B|² over the turns' axes n (Eqs. 30 to 33)."""
    motions = all_pairs(anchor_T_mount, camera_T_target).with_clear_axes()
    alpha, beta = (_pure(vectors / np.linalg.norm(vectors, axis=1, keepdims=True)) for vectors in motions.vectors())
    difference = _product_matrix(alpha, 1.0) - _product_matrix(beta, -1.0)
    quadratic = np.einsum("kji,kjl->il", difference, difference)
    quaternion = np.linalg.eigh(quadratic)[1][:, 0]
    return with_translation(motions, rotation_from_quaternion(quaternion))


def _pure(vectors: Array) -> Array:
    return np.concatenate([np.zeros((len(vectors), 1)), vectors], axis=1)


# R. Tsai & R. Lenz, "A new technique for fully autonomous and efficient 3D robotics hand/eye calibration", T-RA 1989.
#
# The rotation of X is found as P' = tan(theta / 2) times its axis, which is infinite at 180 degrees, a common
# mounting. So the same equations are also solved with the camera's frame turned by 180 degrees about each of its axes
# (X turns by at most 120 degrees in one of the four), and the solution that fits the rotations best is kept.

HALF_TURNS = (np.eye(3), np.diag([1.0, -1, -1]), np.diag([-1.0, 1, -1]), np.diag([-1.0, -1, 1]))


def tsai(anchor_T_mount: Array, camera_T_target: Array) -> Array:
    """X (4, 4), rotation and then translation."""
    motions = all_pairs(anchor_T_mount, camera_T_target).with_clear_axes()
    alpha, beta = motions.vectors()
    mount, camera = _modified_rodrigues(alpha), _modified_rodrigues(beta)
    # R carries the turned camera axes turn' k onto the mount's; X's rotation is R turn', and turn is symmetric.
    candidates = []
    for turn in HALF_TURNS:  # P' (3,) from skew(P_mount + P_camera) P' = P_camera - P_mount (Eq. 12)
        coefficients, right_hand = skew(mount + camera @ turn).reshape(-1, 3), (camera @ turn - mount).reshape(-1)
        half_tangent = np.asarray(np.linalg.lstsq(coefficients, right_hand, rcond=None)[0], float)
        candidates.append(_rotation(half_tangent) @ turn)
    rotation = min(candidates, key=lambda candidate: float(np.linalg.norm(alpha - beta @ candidate.T)))
    return with_translation(motions, rotation)


def _modified_rodrigues(vectors: Array) -> Array:
    """P = 2 sin(theta / 2) n of rotation vectors (k, 3) (Eq. 9)."""
    angle = np.linalg.norm(vectors, axis=1, keepdims=True)
    scaled: Array = 2 * np.sin(angle / 2) * vectors / angle
    return scaled


def _rotation(half_tangent: Array) -> Array:
    """Rotation (3, 3) of P' by Eqs. 14 and 10."""
    p = 2 * half_tangent / np.sqrt(1 + half_tangent @ half_tangent)
    rotation: Array = (1 - p @ p / 2) * np.eye(3) + (np.outer(p, p) + np.sqrt(max(4 - float(p @ p), 0.0)) * skew(p)) / 2
    return rotation


# K. Daniilidis, "Hand-eye calibration using dual quaternions", Int. J. Robotics Research 18(3), 1999.


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
    return real, (_product_matrix(_pure(motions[:, :3, 3]), 1.0) @ real[..., None])[..., 0] / 2


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


def _product_matrix(quaternions: Array, sign: float) -> Array:
    """(k, 4, 4) of scalar-first quaternions (k, 4): p q = matrix(p, 1) @ q = matrix(q, -1) @ p."""
    scalar, vector = quaternions[:, 0], quaternions[:, 1:]
    result = np.zeros((len(quaternions), 4, 4))
    result[:, 0, 0], result[:, 0, 1:], result[:, 1:, 0] = scalar, -vector, vector
    result[:, 1:, 1:] = scalar[:, None, None] * np.eye(3) + sign * skew(vector)
    return result


# F. Park & B. Martin, "Robot sensor calibration: solving AX = XB on the Euclidean group", IEEE T-RA 10(5) 1994.


def park(anchor_T_mount: Array, camera_T_target: Array) -> Array:
    """X (4, 4): the rotation that carries the camera's rotation vectors onto the mount's (Eq. 20)."""
    motions = all_pairs(anchor_T_mount, camera_T_target).with_clear_axes()
    alpha, beta = motions.vectors()
    # (M' M)^(-1/2) M' with M = sum beta alpha' is the polar factor; by SVD it also exists for two motions.
    rotation, _ = nearest_rotation(alpha.T @ beta)
    return with_translation(motions, rotation)


# M. Shah, "Solving the robot-world/hand-eye calibration problem using the Kronecker product", JMR 5(3), 2013.
#
# A X = Y B with A = anchor_T_mount, X = mount_T_camera, Y = anchor_T_target, B = target_T_camera.


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


ClosedForm = Callable[[Array, Array], Array]

CLOSED_FORMS: dict[str, ClosedForm] = {
    "three-pose": three_pose,
    "tsai": tsai,
    "park": park,
    "horaud": horaud,
    "daniilidis": daniilidis,
    "shah": shah,
    "kronecker": kronecker,
}
