"""All pairs of views at once, at a cost linear in the number of views.

The sum over all pairs of |R_Aij R - R R_Bij|² equals, after turning every term back by the two orientations of its
pair, 2 n sum_i |K_i vec R - mean|² with K_i = R_i ⊗ S_i' (R_i of anchor_T_mount, S_i of camera_T_target). The K_i are
orthogonal, so the minimum is where |sum_i K_i vec R| is largest: the first right singular vector of a 9×9 sum.
Sources: N. Andreff, R. Horaud & B. Espiau, "Robot hand-eye calibration using structure-from-motion", IJRR 20(3) 2001,
Eq. 15 (the Kronecker form); M. Shah, J. Mechanisms Robotics 5(3) 2013, Eq. 24 (the singular vectors of the sum).
"""

import numpy as np

from calibration.transforms import Array, nearest_rotation, transform


def kronecker(anchor_T_mount: Array, camera_T_target: Array) -> Array:
    """X (4, 4): rotation over all pairs, then translation where the target's points scatter least."""
    rotation = rotation_of_all_pairs(anchor_T_mount[:, :3, :3], camera_T_target[:, :3, :3])
    turned = anchor_T_mount[:, :3, :3]
    # R_i t + R_i R s_i + t_i is the target's origin in the anchor, the same for every view: remove its mean.
    offset = (turned @ rotation @ camera_T_target[:, :3, 3:])[..., 0] + anchor_T_mount[:, :3, 3]
    mean_turn, mean_offset = turned.mean(axis=0), offset.mean(axis=0)
    n = len(turned)
    normal = n * (np.eye(3) - mean_turn.T @ mean_turn)
    right_hand = n * mean_turn.T @ mean_offset - np.einsum("nji,nj->i", turned, offset, optimize=False)
    return transform(rotation, np.linalg.lstsq(normal, right_hand, rcond=None)[0])


def rotation_of_all_pairs(anchor_R_mount: Array, camera_R_target: Array) -> Array:
    """Rotation of X (3, 3) from orientations (n, 3, 3) each."""
    vector = np.linalg.svd(summed_products(anchor_R_mount, camera_R_target))[2][0].reshape(3, 3)
    return nearest_rotation(vector * np.sign(np.linalg.det(vector)))[0]


def summed_products(anchor_R_mount: Array, camera_R_target: Array) -> Array:
    """sum_i R_i ⊗ S_i' (9, 9), so that it maps vec(X), row by row, to vec(sum_i R_i X S_i)."""
    n = len(anchor_R_mount)
    products = anchor_R_mount.reshape(n, 9).T @ camera_R_target.reshape(n, 9)
    # products[a b, c d] = sum R[a, b] S[c, d] and (R X S)[a, d] = R[a, b] X[b, c] S[c, d].
    summed: Array = products.reshape(3, 3, 3, 3).transpose(0, 3, 1, 2).reshape(9, 9)
    return summed
