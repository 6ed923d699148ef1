"""The target's pose in the camera predicted by X, the target's pose and the robot's, with its derivatives.

    camera_T_target = inverse(anchor_T_mount @ mount_T_camera) @ anchor_T_target

Derivatives are of z in exp(z) @ camera_T_target, by x in mount_T_camera @ exp(x), by y in anchor_T_target @ exp(y) and
by b in base_T_flange @ exp(b); exp(.) as in `transforms.transform_from_vector`. All functions take stacks (..., 4, 4).
The estimators from pixels (`likelihood`), from the poses that images imply (`diagnosis`) and from poses alone
(`pose_pairs`) have this model in common.
"""

import numpy as np

from calibration.problem import Setup
from calibration.transforms import Array, adjoint, inverse, vector_from_transform

MAX_STEP = np.repeat([0.5, 2000.0], 3)
"""rad, mm: bound of a step, larger than the error of any initial guess within a cell."""


def predicted_camera_T_target(anchor_T_mount: Array, mount_T_camera: Array, anchor_T_target: Array) -> Array:
    """The predicted camera_T_target (..., 4, 4)."""
    return inverse(anchor_T_mount @ mount_T_camera) @ anchor_T_target


def derivative_by_shared(camera_T_target: Array) -> Array:
    """dz / d[x, y] (..., 6, 12), of X and of the target's pose."""
    by_x = np.broadcast_to(-np.eye(6), (*camera_T_target.shape[:-2], 6, 6))
    return np.concatenate([by_x, adjoint(camera_T_target)], axis=-1)


def derivative_by_flange(setup: Setup, camera_T_target: Array, mount_T_camera: Array, anchor_T_target: Array) -> Array:
    """dz / db (..., 6, 6), of the robot's pose."""
    if setup == "eye-in-hand":
        return np.broadcast_to(-adjoint(inverse(mount_T_camera)), (*camera_T_target.shape[:-2], 6, 6))
    return adjoint(camera_T_target @ inverse(anchor_T_target))


def pose_residuals(predicted_T: Array, seen_T: Array) -> Array:
    """z (..., 6) with exp(z) @ seen = predicted, of two camera_T_target: [rotation vector rad, translation mm]."""
    return vector_from_transform(predicted_T @ inverse(seen_T))


def clip_step(step: Array) -> Array:
    """Steps (..., p) of one pose after the other [rad, mm], each element clipped to ± MAX_STEP (trust region).

    A last number that begins no whole pose, the logarithm of a scale, is clipped as an angle.
    """
    longest = np.resize(MAX_STEP, step.shape[-1])
    return np.clip(step, -longest, longest)
