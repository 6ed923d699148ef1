"""Song et al., "Multi-view coordinate system transformation based on robot": three poses, two motions, Eqs. 7 to 9.

With M = camera_T_target_1 @ camera_T_target_2^-1 and A = anchor_T_mount_1^-1 @ anchor_T_mount_2 the paper writes
M X = X A (Eq. 2), so its X maps mount to camera coordinates: camera_T_mount, the inverse of the usual mount_T_camera.
"""

from dataclasses import dataclass

import numpy as np

from calibration.errors import GeometryError
from calibration.transforms import Array, inverse, nearest_rotation, rotation_angle_rad, transform, vector_from_rotation


@dataclass(frozen=True, eq=False)
class ThreePose:
    """The paper's X with a proper rotation.

    camera_T_mount : (4, 4).
    distance_from_rotation : Frobenius distance of the matrix of Eq. 7, a rotation only in the absence of noise, from
        the nearest rotation.
    axis_angle_rad : angle between the axes of the robot's two motions.
    """

    camera_T_mount: Array
    distance_from_rotation: float
    axis_angle_rad: float


def three_pose(anchor_T_mount: Array, camera_T_target: Array) -> Array:
    """mount_T_camera (4, 4) from the first three views. Raises GeometryError as `solve_three_pose`."""
    return inverse(solve_three_pose(anchor_T_mount, camera_T_target).camera_T_mount)


def solve_three_pose(anchor_T_mount: Array, camera_T_target: Array) -> ThreePose:
    """Eqs. 7 to 9 on the first three views, with the rotation projected to SO(3) before Eqs. 8 and 9.

    Raises GeometryError when a motion has no rotation or both have the same axis.
    """
    mount = inverse(anchor_T_mount[:1]) @ anchor_T_mount[1:3]  # A_a, A_b
    camera = camera_T_target[:1] @ inverse(camera_T_target[1:3])  # M_a, M_b
    k_mount, k_camera = _axes(mount), _axes(camera)
    with_cross = [np.column_stack([*k, np.cross(*k)]) for k in (k_camera, k_mount)]
    if abs(np.linalg.det(with_cross[1])) < 1e-12:
        raise GeometryError("the two motions turn about the same axis: Eq. 7 has no inverse")
    rotation, distance = nearest_rotation(with_cross[0] @ np.linalg.inv(with_cross[1]))
    coefficients: Array = (camera[:, :3, :3] - np.eye(3)).reshape(6, 3)  # Eqs. 8, 9
    right_hand: Array = (mount[:, :3, 3] @ rotation.T - camera[:, :3, 3]).reshape(6)
    translation = np.linalg.lstsq(coefficients, right_hand, rcond=None)[0]
    cosine = float(abs(k_mount[0] @ k_mount[1]))
    return ThreePose(transform(rotation, translation), distance, float(np.arccos(min(cosine, 1.0))))


def _axes(motions: Array) -> Array:
    """Unit rotation axes (2, 3), by Rodrigues' formula."""
    if np.any(rotation_angle_rad(motions[:, :3, :3]) < 1e-9):
        raise GeometryError("a motion without a turn has no axis: Eq. 7 needs two turns")
    vectors = vector_from_rotation(motions[:, :3, :3])
    axes: Array = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return axes
