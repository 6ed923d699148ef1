"""The chain camera_T_target = f(X, target's pose, correction of the robot's pose), for both set-ups.

    eye-in-hand    Z_i = X^-1 (B_i C_i)^-1 Y        B_i = base_T_flange as the robot reported it
    eye-to-hand    Z_i = X^-1 (B_i C_i) Y           C_i = [exp(w_i), d_i], what it should have added

C_i acts about the flange's origin, where a robot's rotation error and translation error are independent.
Perturbations: X @ exp(.), Y @ exp(.), exp(.) @ Z. Model: K. Strobl & G. Hirzinger, IROS 2006.
"""

from dataclasses import dataclass, replace

import numpy as np

from calibration.likelihood.axis_offset import GivenCoordinate
from calibration.observations.pose_model import derivative_by_flange, predicted_camera_T_target
from calibration.problem import Setup, anchor_T_mount_of, base_T_flange_of
from calibration.transforms import (
    Array,
    inverse,
    rotation_from_vector,
    skew,
    transform_from_vector,
    vector_from_transform,
)


@dataclass(frozen=True, eq=False)
class Chain:
    """X (4, 4), the target's pose (4, 4), and n robot poses (n, 4, 4) with `corrections` (n, 6) [rad, mm].

    `given`: what is known of X or the target's pose along the only axis of rotation.
    """

    setup: Setup
    base_T_flange: Array
    mount_T_camera: Array
    anchor_T_target: Array
    corrections: Array
    given: GivenCoordinate | None = None

    def corrected_base_T_flange(self) -> Array:
        """(n, 4, 4)"""
        return self.base_T_flange @ transform_from_vector(self.corrections)

    def camera_T_target(self) -> Array:
        """(n, 4, 4)"""
        anchor_T_mount = anchor_T_mount_of(self.setup, self.corrected_base_T_flange())
        return predicted_camera_T_target(anchor_T_mount, self.mount_T_camera, self.anchor_T_target)

    def flange_T_target(self) -> Array:
        """The target (n, 4, 4) in the frame of the flange, as each view saw it."""
        seen = self.mount_T_camera @ self.camera_T_target()
        return seen if self.setup == "eye-in-hand" else inverse(self.corrected_base_T_flange()) @ seen

    def correction_jacobian(self, camera_T_target: Array) -> Array:
        """Derivative (n, 6, 6) of each pose Z by the correction of its robot pose."""
        by_motion = derivative_by_flange(self.setup, camera_T_target, self.mount_T_camera, self.anchor_T_target)
        return by_motion @ _motion_by_vector(self.corrections)

    def with_corrections_from(self, camera_T_target: Array) -> "Chain":
        """The chain with the corrections that reproduce the given poses (n, 4, 4) exactly."""
        anchor_T_mount = self.anchor_T_target @ inverse(self.mount_T_camera @ camera_T_target)
        base_T_flange = base_T_flange_of(self.setup, anchor_T_mount)
        return replace(self, corrections=vector_from_transform(inverse(self.base_T_flange) @ base_T_flange))

    def apply_step(self, step: Array, corrections: Array) -> "Chain":
        """X and Y changed by a step (..., 12), with new corrections (n, 6). A step (n, 12) gives an X for each view."""
        return replace(
            self,
            mount_T_camera=self.mount_T_camera @ transform_from_vector(step[..., :6]),
            anchor_T_target=self.anchor_T_target @ transform_from_vector(step[..., 6:]),
            corrections=corrections,
        )

    def without_corrections(self) -> "Chain":
        """The same X and Y with the robot's poses as reported."""
        return replace(self, corrections=np.zeros_like(self.corrections))

    def for_poses(self, base_T_flange: Array) -> "Chain":
        """The same X and Y for other robot poses (n, 4, 4)."""
        return replace(self, base_T_flange=base_T_flange, corrections=np.zeros((len(base_T_flange), 6)))


def _motion_by_vector(corrections: Array) -> Array:
    """(n, 6, 6): gamma in C' = C @ exp(gamma) by a change of C's vector [w, d].

    gamma_w = Jr(w) dw (right Jacobian of SO(3); Sola et al., arXiv:1812.01537, Eq. 143), gamma_d = exp(w)' dd.
    """
    turn = corrections[:, :3]
    angle = np.linalg.norm(turn, axis=1)[:, None, None]
    small = angle < 1e-4
    safe = np.where(small, 1.0, angle)
    first = np.where(small, 0.5, (1 - np.cos(safe)) / safe**2)
    second = np.where(small, 1 / 6, (safe - np.sin(safe)) / safe**3)
    hat = skew(turn)
    result = np.zeros((len(corrections), 6, 6))
    result[:, :3, :3] = np.eye(3) - first * hat + second * hat @ hat
    result[:, 3:, 3:] = np.swapaxes(rotation_from_vector(turn), 1, 2)
    return result
