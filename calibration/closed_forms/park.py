"""F. Park & B. Martin, "Robot sensor calibration: solving AX = XB on the Euclidean group", IEEE T-RA 10(5) 1994."""

from calibration.closed_forms.motions import all_pairs, with_translation
from calibration.transforms import Array, nearest_rotation


def park(anchor_T_mount: Array, camera_T_target: Array) -> Array:
    """X (4, 4): the rotation that carries the camera's rotation vectors onto the mount's (Eq. 20)."""
    motions = all_pairs(anchor_T_mount, camera_T_target).with_clear_axes()
    alpha, beta = motions.vectors()
    # (M' M)^(-1/2) M' with M = sum beta alpha' is the polar factor; by SVD it also exists for two motions.
    rotation, _ = nearest_rotation(alpha.T @ beta)
    return with_translation(motions, rotation)
