"""Least squares over all pairs of views, at a cost linear in the number of views.

The sum over all pairs of |R_Aij R - R R_Bij|² equals, after turning every term back by the two orientations of its
pair, 2 n sum_i |K_i vec R - mean|² with K_i = R_i ⊗ S_i' (R_i of anchor_T_mount, S_i of camera_T_target). The K_i are
orthogonal, so the minimum is where |sum_i K_i vec R| is largest: the first right singular vector of a 9×9 sum.
Sources: N. Andreff, R. Horaud & B. Espiau, "Robot hand-eye calibration using structure-from-motion", IJRR 20(3) 2001,
Eq. 15 (the Kronecker form); M. Shah, J. Mechanisms Robotics 5(3) 2013, Eq. 24 (the singular vectors of the sum).
"""

import numpy as np

from calibration.transforms import Array, transform


def kronecker(anchor_T_mount: Array, camera_T_target: Array) -> Array:
    """X (..., 4, 4) of poses (..., n, 4, 4): rotation over all pairs, then the translation of least target scatter.

    Leading dimensions are separate sessions.
    """
    turned = anchor_T_mount[..., :3, :3]
    products = kronecker_sum(turned, camera_T_target[..., :3, :3])
    vectors = np.linalg.svd(products)[2][..., 0, :]
    rotation = as_rotation(vectors.reshape(*vectors.shape[:-1], 3, 3))
    # R_i t + R_i R s_i + t_i is the target's origin in the anchor, the same for every view: remove its mean.
    offset = (turned @ rotation[..., None, :, :] @ camera_T_target[..., :3, 3:]) + anchor_T_mount[..., :3, 3:]
    mean_turn, mean_offset = turned.mean(axis=-3), offset.mean(axis=-3)
    normal = np.eye(3) - np.swapaxes(mean_turn, -1, -2) @ mean_turn
    right_hand = np.swapaxes(mean_turn, -1, -2) @ mean_offset - (np.swapaxes(turned, -1, -2) @ offset).mean(axis=-3)
    return transform(rotation, (np.linalg.pinv(normal, rcond=1e-12, hermitian=True) @ right_hand)[..., 0])


def kronecker_sum(anchor_R_mount: Array, camera_R_target: Array) -> Array:
    """sum_i R_i ⊗ S_i' (..., 9, 9), so that it maps vec(X), row by row, to vec(sum_i R_i X S_i)."""
    lead, n = anchor_R_mount.shape[:-3], anchor_R_mount.shape[-3]
    left = np.swapaxes(anchor_R_mount.reshape(*lead, n, 9), -1, -2)
    products: Array = left @ camera_R_target.reshape(*lead, n, 9)
    # products[a b, c d] = sum R[a, b] S[c, d] and (R X S)[a, d] = R[a, b] X[b, c] S[c, d].
    summed: Array = np.swapaxes(products.reshape(*lead, 3, 3, 3, 3), -1, -3)
    result: Array = np.ascontiguousarray(np.swapaxes(summed, -1, -2))
    return result.reshape(*lead, 9, 9)


def as_rotation(matrices: Array) -> Array:
    """The rotations nearest to multiples, of either sign, of rotations (..., 3, 3)."""
    u, _, vt = np.linalg.svd(matrices)
    product: Array = u @ vt
    proper: Array = product * np.sign(np.linalg.det(product))[..., None, None]
    return proper
