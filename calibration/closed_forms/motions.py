"""Relative motions of mount and camera between views, A X = X B.

From anchor_T_target = anchor_T_mount_i @ X @ camera_T_target_i for every view i it follows for two views i, j that

    (anchor_T_mount_j^-1 @ anchor_T_mount_i) X = X (camera_T_target_j @ camera_T_target_i^-1)
                       A_ij                                        B_ij
"""

from dataclasses import dataclass

import numpy as np

from calibration.transforms import Array, inverse, rotation_angle_rad, transform, vector_from_rotation

MIN_TURN_RAD = np.radians(0.5)
"""The axis of a smaller rotation is not determined in practice."""

MAX_TURN_RAD = np.radians(175.0)
"""Near half a turn the sign of the axis depends on noise."""


@dataclass(frozen=True, eq=False)
class MotionPairs:
    """Pairs of views: `mount` A (k, 4, 4) and `camera` B (k, 4, 4)."""

    mount: Array
    camera: Array

    def with_clear_axes(self) -> "MotionPairs":
        """The pairs with a certain axis: rotations above MIN_TURN_RAD and, if two remain, below MAX_TURN_RAD."""
        mount, camera = rotation_angle_rad(self.mount[:, :3, :3]), rotation_angle_rad(self.camera[:, :3, :3])
        turns = np.minimum(mount, camera) > MIN_TURN_RAD
        certain = turns & (np.maximum(mount, camera) < MAX_TURN_RAD)
        kept = certain if np.count_nonzero(certain) >= 2 else turns
        return MotionPairs(self.mount[kept], self.camera[kept])

    def vectors(self) -> tuple[Array, Array]:
        """Rotation vectors (k, 3) of A and of B."""
        return vector_from_rotation(self.mount[:, :3, :3]), vector_from_rotation(self.camera[:, :3, :3])


def all_pairs(anchor_T_mount: Array, camera_T_target: Array) -> MotionPairs:
    """Every pair i < j: n (n - 1) / 2 motions."""
    i, j = np.triu_indices(len(anchor_T_mount), 1)
    return MotionPairs(inverse(anchor_T_mount[j]) @ anchor_T_mount[i], camera_T_target[j] @ inverse(camera_T_target[i]))


def with_translation(motions: MotionPairs, rotation: Array) -> Array:
    """X (4, 4) of its rotation R and the t of least squares of (R_A - I) t = R t_B - t_A (Tsai & Lenz 1989, Eq. 15)."""
    coefficients: Array = (motions.mount[:, :3, :3] - np.eye(3)).reshape(-1, 3)
    right_hand: Array = (motions.camera[:, :3, 3] @ rotation.T - motions.mount[:, :3, 3]).reshape(-1)
    return transform(rotation, np.linalg.lstsq(coefficients, right_hand, rcond=None)[0])
