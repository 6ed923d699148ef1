"""R. Horaud & F. Dornaika, "Hand-eye calibration", Int. J. Robotics Research 14(3), 1995."""

import numpy as np

from calibration.closed_forms.motions import all_pairs, with_translation
from calibration.closed_forms.quaternions import left_product_matrix, right_product_matrix
from calibration.transforms import Array, rotation_from_quaternion


def horaud(anchor_T_mount: Array, camera_T_target: Array) -> Array:
    """X (4, 4): the unit quaternion q with the least sum |n_A q - q n_B|² over the turns' axes n (Eqs. 30 to 33)."""
    motions = all_pairs(anchor_T_mount, camera_T_target).with_clear_axes()
    alpha, beta = (_pure(vectors / np.linalg.norm(vectors, axis=1, keepdims=True)) for vectors in motions.vectors())
    difference = left_product_matrix(alpha) - right_product_matrix(beta)
    quadratic = np.einsum("kji,kjl->il", difference, difference)
    quaternion = np.linalg.eigh(quadratic)[1][:, 0]
    return with_translation(motions, rotation_from_quaternion(quaternion))


def _pure(vectors: Array) -> Array:
    return np.concatenate([np.zeros((len(vectors), 1)), vectors], axis=1)
