"""Rigid transforms as 4×4 arrays, millimetres and radians.

`a_T_b` maps coordinates in b to coordinates in a: `p_a = a_T_b @ p_b`, so neighbours cancel in
`base_T_flange @ flange_T_camera`. Every function accepts stacks: (..., 4, 4), (..., 3, 3), (..., 4).
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calibration.errors import GeometryError

Array = NDArray[np.float64]

QUATERNION_NORM_TOLERANCE = 2e-3
"""Largest error of a norm. Text with 3 decimals gives up to 9e-4; more means another order or damaged text."""

MAX_SINE_ANGLE_RAD = 3.0
"""Beyond this angle, close to half a turn, the sine determines the axis poorly and the general conversion is used."""

MIN_DOUBLE_SINE = 1e-12
"""Below it a rotation vector equals half the difference of the matrix and its transpose, in double precision."""

_PRODUCTS = np.array([
    [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, -1, 0], [0, 0, 0, -1]],  # R_00 = ww + xx - yy - zz
    [[0, 0, 0, -1], [0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 0]],  # R_01 = 2 (xy - wz)
    [[0, 0, 1, 0], [0, 0, 0, 1], [1, 0, 0, 0], [0, 1, 0, 0]],  # R_02 = 2 (xz + wy)
    [[0, 0, 0, 1], [0, 0, 1, 0], [0, 1, 0, 0], [1, 0, 0, 0]],  # R_10 = 2 (xy + wz)
    [[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 1, 0], [0, 0, 0, -1]],  # R_11 = ww - xx + yy - zz
    [[0, -1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1], [0, 0, 1, 0]],  # R_12 = 2 (yz - wx)
    [[0, 0, -1, 0], [0, 0, 0, 1], [-1, 0, 0, 0], [0, 1, 0, 0]],  # R_20 = 2 (xz - wy)
    [[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1], [0, 0, 1, 0]],  # R_21 = 2 (yz + wx)
    [[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]],  # R_22 = ww - xx - yy + zz
], float).reshape(9, 16)  # fmt: skip
"""(9, 16): R, row by row, from the products q qT of a unit quaternion wxyz; transposed, 4 q qT - 1 from R."""


def transform(rotation: ArrayLike, translation_mm: ArrayLike) -> Array:
    """a_T_b (..., 4, 4) from a rotation (..., 3, 3) and a translation (..., 3) in mm."""
    rotation, translation_mm = np.asarray(rotation, float), np.asarray(translation_mm, float)
    shape = np.broadcast_shapes(rotation.shape[:-2], translation_mm.shape[:-1])
    result = np.zeros((*shape, 4, 4))
    result[..., :3, :3] = rotation
    result[..., :3, 3] = translation_mm
    result[..., 3, 3] = 1.0
    return result


def inverse(a_T_b: Array) -> Array:
    """b_T_a (..., 4, 4), by the transposed rotation."""
    b_R_a = np.swapaxes(a_T_b[..., :3, :3], -1, -2)
    return transform(b_R_a, -(b_R_a @ a_T_b[..., :3, 3:])[..., 0])


def map_points(a_T_b: Array, points_b: ArrayLike) -> Array:
    """Points (..., n, 3) of frame b in frame a."""
    return np.asarray(points_b, float) @ np.swapaxes(a_T_b[..., :3, :3], -1, -2) + a_T_b[..., None, :3, 3]


def rotation_from_quaternion(quaternion_wxyz: ArrayLike) -> Array:
    """Rotation (..., 3, 3) of a scalar-first quaternion (paper, Eq. 11).

    Raises GeometryError when the norm is further from 1 than `QUATERNION_NORM_TOLERANCE`.
    """
    quaternion_wxyz = np.asarray(quaternion_wxyz, float)
    norm = np.linalg.norm(quaternion_wxyz, axis=-1)
    if not np.all(np.abs(norm - 1.0) <= QUATERNION_NORM_TOLERANCE):
        raise GeometryError(f"quaternion norm {np.ravel(norm)[np.argmax(np.abs(np.ravel(norm) - 1))]:.6g} is not 1")
    return _rotation(quaternion_wxyz / norm[..., None])


def _rotation(unit_quaternion_wxyz: Array) -> Array:
    products = unit_quaternion_wxyz[..., :, None] * unit_quaternion_wxyz[..., None, :]
    shape = unit_quaternion_wxyz.shape[:-1]
    rotation: Array = (products.reshape(*shape, 16) @ _PRODUCTS.T).reshape(*shape, 3, 3)
    return rotation


def quaternion_from_rotation(rotation: ArrayLike) -> Array:
    """Scalar-first quaternion (..., 4), w >= 0, of a rotation (..., 3, 3), by its largest component (Shepperd 1978)."""
    rotation = np.asarray(rotation, float)
    shape = rotation.shape[:-2]
    products = (rotation.reshape(*shape, 9) @ _PRODUCTS).reshape(*shape, 4, 4) + np.eye(4)
    largest = np.argmax(np.diagonal(products, axis1=-2, axis2=-1), axis=-1)
    row: Array = np.take_along_axis(products, largest[..., None, None], axis=-2)[..., 0, :]
    first = np.argmax(row != 0, axis=-1)[..., None]
    sign = np.sign(np.take_along_axis(row, first, axis=-1))
    quaternion: Array = row * (sign / np.linalg.norm(row, axis=-1, keepdims=True))
    return quaternion


def transform_from_quaternion(translation_mm: ArrayLike, quaternion_wxyz: ArrayLike) -> Array:
    """a_T_b (..., 4, 4) from a translation (..., 3) in mm and a scalar-first quaternion (..., 4), ABB's pose format.

    Raises GeometryError as `rotation_from_quaternion`.
    """
    return transform(rotation_from_quaternion(quaternion_wxyz), translation_mm)


def rotation_from_vector(rotation_vector_rad: ArrayLike) -> Array:
    """Rotation (..., 3, 3) of a rotation vector (..., 3) in rad: exp."""
    vector = np.asarray(rotation_vector_rad, float)
    half = 0.5 * np.sqrt((vector * vector).sum(axis=-1))
    quaternion_wxyz = np.empty((*vector.shape[:-1], 4))
    quaternion_wxyz[..., 0] = np.cos(half)
    quaternion_wxyz[..., 1:] = (0.5 * np.sinc(half / np.pi))[..., None] * vector
    return _rotation(quaternion_wxyz)


def vector_from_rotation(rotation: ArrayLike) -> Array:
    """Rotation vector (..., 3) in rad of a rotation (..., 3, 3), angle in [0, pi]: log."""
    rotation = np.asarray(rotation, float)
    vector, double_sine, angle = _turn(rotation)
    small = double_sine < MIN_DOUBLE_SINE
    vector *= np.where(small, 0.5, angle / np.where(small, 1.0, double_sine))[..., None]
    far = angle > MAX_SINE_ANGLE_RAD
    if np.any(far):
        quaternion_wxyz = quaternion_from_rotation(rotation[far])
        sine = np.linalg.norm(quaternion_wxyz[..., 1:], axis=-1)
        vector[far] = (2 * np.arctan2(sine, quaternion_wxyz[..., 0]) / sine)[..., None] * quaternion_wxyz[..., 1:]
    return vector


def _turn(rotation: Array) -> tuple[Array, Array, Array]:
    """2 sin(angle) times the axis (..., 3), 2 sin(angle) and the angle (...) of rotations (..., 3, 3)."""
    vector: Array = np.empty(rotation.shape[:-1])
    vector[..., 0] = rotation[..., 2, 1] - rotation[..., 1, 2]
    vector[..., 1] = rotation[..., 0, 2] - rotation[..., 2, 0]
    vector[..., 2] = rotation[..., 1, 0] - rotation[..., 0, 1]
    double_sine = np.sqrt((vector * vector).sum(axis=-1))
    trace = rotation[..., 0, 0] + rotation[..., 1, 1] + rotation[..., 2, 2]
    return vector, double_sine, np.arctan2(double_sine, trace - 1)


def rotation_angle_rad(rotation: ArrayLike) -> Any:
    """Angle of a rotation (..., 3, 3) in rad, in [0, pi]; a float for one, an array for a stack."""
    return _turn(np.asarray(rotation, float))[2]


def transform_from_vector(vector: ArrayLike) -> Array:
    """a_T_b (..., 4, 4) of vectors (..., 6) [rotation vector rad, translation mm], written exp(.) in this package.

    Rotation and translation do not act on each other: this is the exponential of SO(3) × R³, not of SE(3).
    """
    vector = np.asarray(vector, float)
    return transform(rotation_from_vector(vector[..., :3]), vector[..., 3:])


def vector_from_transform(a_T_b: Array) -> Array:
    """[rotation vector rad, translation mm] (..., 6) of transforms (..., 4, 4), the inverse of the above."""
    return np.concatenate([vector_from_rotation(a_T_b[..., :3, :3]), a_T_b[..., :3, 3]], axis=-1)


def nearest_rotation(matrix: ArrayLike) -> tuple[Array, float]:
    """The rotation nearest to a matrix (3, 3) in the Frobenius norm, by SVD, and that distance.

    Raises GeometryError for elements that are not finite.
    """
    matrix = np.asarray(matrix, float)
    if not np.all(np.isfinite(matrix)):
        raise GeometryError("a matrix with non-finite elements has no nearest rotation")
    u, _, vt = np.linalg.svd(matrix)
    rotation: Array = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    return rotation, float(np.linalg.norm(matrix - rotation))


def skew(vector: ArrayLike) -> Array:
    """[v]x (..., 3, 3), so that skew(v) @ w = cross(v, w)."""
    vector = np.asarray(vector, float)
    result = np.zeros((*vector.shape[:-1], 3, 3))
    result[..., 0, 1], result[..., 0, 2], result[..., 1, 2] = -vector[..., 2], vector[..., 1], -vector[..., 0]
    return result - np.swapaxes(result, -1, -2)


def adjoint(a_T_b: Array) -> Array:
    """(..., 6, 6): a_T_b @ exp(v) = exp(adjoint(a_T_b) @ v) @ a_T_b, for v = [rotation, translation]."""
    rotation = a_T_b[..., :3, :3]
    result = np.zeros((*a_T_b.shape[:-2], 6, 6))
    result[..., :3, :3] = result[..., 3:, 3:] = rotation
    result[..., 3:, :3] = skew(a_T_b[..., :3, 3]) @ rotation
    return result


def difference(a_T_b: Array, a_T_c: Array) -> tuple[float, float]:
    """Distance between two transforms (4, 4): (translation in mm, rotation in rad)."""
    b_T_c = inverse(a_T_b) @ a_T_c
    return float(np.linalg.norm(b_T_c[:3, 3])), float(rotation_angle_rad(b_T_c[:3, :3]))
