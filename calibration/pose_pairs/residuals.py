"""Residuals of pairs of poses and their derivatives by X, the target's pose and a scale.

The camera sees `camera_T_target = inverse(anchor_T_mount @ X) @ Y`, lengths multiplied by `scale`, and moved along its
optical axis as another focal length does: by `depth` at the middle of what it sees of the target. A residual is
predicted less seen, of the target in the camera: [rotation vector in rad, translation of its origin in mm].
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.closed_forms.kronecker import as_rotation, kronecker
from calibration.observations.pose_model import derivative_by_flange, derivative_by_shared, predicted_camera_T_target
from calibration.problem import Setup, anchor_T_mount_of
from calibration.transforms import Array, adjoint, inverse, skew, transform, transform_from_vector, vector_from_rotation

MIN_VARIANCES = np.repeat([1e-6, 1e-3], 3) ** 2
"""rad², mm²: below the resolution of any controller or camera."""


def floor_variances(scale: float) -> Array:
    """Variances (6,) that are added to every residual; lengths in the camera's unit."""
    return np.asarray(MIN_VARIANCES * np.repeat([1.0, scale**2], 3), np.float64)


@dataclass(frozen=True, eq=False)
class PosePairs:
    """n views: the robot's poses and the camera's poses of the target, both (n, 4, 4).

    `length_sigmas`: standard deviations of [log scale, log depth] where they are unknowns, or of the first alone; it is
    infinite for a single moving camera without target.
    `covariance` (n, 6, 6) of the camera's errors, as of the residuals, where it is known.
    """

    setup: Setup
    base_T_flange: Array
    camera_T_target: Array
    length_sigmas: tuple[float, ...] = ()
    covariance: Array | None = None

    def __len__(self) -> int:
        return len(self.base_T_flange)

    def take(self, chosen: NDArray[np.bool_]) -> "PosePairs":
        """Only the chosen views."""
        return replace(
            self,
            base_T_flange=self.base_T_flange[chosen],
            camera_T_target=self.camera_T_target[chosen],
            covariance=None if self.covariance is None else self.covariance[chosen],
        )

    def anchor_T_mount(self) -> Array:
        """(n, 4, 4), see `calibration.problem`."""
        return anchor_T_mount_of(self.setup, self.base_T_flange)


@dataclass(frozen=True, eq=False)
class ScaledChain:
    """`mount_T_camera`, `anchor_T_target` (4, 4); `scale`: length in the camera's poses over true length.

    `depth`: the same of the depth of the target's middle, besides `scale`.
    """

    mount_T_camera: Array
    anchor_T_target: Array
    scale: float = 1.0
    depth: float = 1.0

    def apply_step(self, step: Array) -> "ScaledChain":
        """The chain changed by a step [X 6, Y 6], by [X 6, Y 6, log scale], or with log depth behind."""
        X = self.mount_T_camera @ transform_from_vector(step[:6])
        Y = self.anchor_T_target @ transform_from_vector(step[6:12])
        scale, depth = np.exp([*step[12:], 0.0, 0.0][:2]).tolist()
        return ScaledChain(X, Y, self.scale * scale, self.depth * depth)


@dataclass(frozen=True, eq=False)
class LinearisedPairs:
    """Residuals (n, 6) and their derivatives at a chain.

    by_shared : (n, 6, p) by the chain's parameters.
    known : (p, p + 1) what is known of them beforehand, as information and gradient.
    predicted : (n, 4, 4) poses of the target, with the camera's lengths.
    by_camera, by_flange, by_base : (n, 6, 6) by a small motion [rotation, translation] of each frame.
    scale : the chain's.
    floor : (n, 6, 6) covariance that every residual has besides that of the sources of noise.
    """

    residuals: Array
    by_shared: Array
    known: Array
    predicted: Array
    by_camera: Array
    by_flange: Array
    by_base: Array
    scale: float
    floor: Array


def linearise(pairs: PosePairs, chain: ScaledChain) -> LinearisedPairs:
    """Residuals and derivatives at a chain."""
    X, Y = chain.mount_T_camera, chain.anchor_T_target
    metric = predicted_camera_T_target(pairs.anchor_T_mount(), X, Y)
    predicted = metric.copy()
    # The target's middle is the point of its plane that is nearest to the optical axis in all views.
    across = pairs.camera_T_target[:, :2]
    middle = np.linalg.lstsq(across[:, :, :2].reshape(-1, 2), -across[:, :, 3].reshape(-1), rcond=None)[0]
    depths = chain.scale * (metric[:, 2, 3] + metric[:, 2, :2] @ middle)
    predicted[:, :3, 3] *= chain.scale
    predicted[:, 2, 3] += (chain.depth - 1) * depths
    turn = metric[:, :3, :3] @ np.swapaxes(pairs.camera_T_target[:, :3, :3], 1, 2)
    shift = predicted[:, :3, 3] - pairs.camera_T_target[:, :3, 3]
    by_camera = residuals_by_motion(metric, np.broadcast_to(np.eye(6), (len(pairs), 6, 6)), chain.scale)
    by_flange = by_camera @ derivative_by_flange(pairs.setup, metric, X, Y)
    q = len(pairs.length_sigmas)
    by_lengths = np.zeros((len(pairs), 6, 2))
    by_lengths[:, 3:, 0], by_lengths[:, 5, 1] = predicted[:, :3, 3], chain.depth * depths
    information = np.array([0.0] * 12 + [sigma**-2 for sigma in pairs.length_sigmas])
    at = np.array([0.0] * 12 + [np.log(chain.scale), np.log(chain.depth)][:q])
    resolution = np.broadcast_to(np.diag(floor_variances(chain.scale)), (len(pairs), 6, 6))
    return LinearisedPairs(
        np.concatenate([vector_from_rotation(turn), shift], axis=1),
        np.concatenate([by_camera @ derivative_by_shared(metric), by_lengths[:, :, :q]], axis=2),
        np.column_stack([np.diag(information), information * at]),
        predicted,
        by_camera,
        by_flange,
        by_flange @ adjoint(inverse(pairs.base_T_flange)),
        chain.scale,
        resolution if pairs.covariance is None else resolution + pairs.covariance,
    )


def residuals_by_motion(camera_T_target: Array, motion: Array, scale: float = 1.0) -> Array:
    """Derivative of the residuals for `exp(motion) @ camera_T_target`."""
    moved = scale * (motion[:, 3:] - skew(camera_T_target[:, :3, 3]) @ motion[:, :3])
    return np.concatenate([motion[:, :3], moved], axis=1)


def initial_chain(pairs: PosePairs) -> ScaledChain:
    """The initial chain: rotation by `kronecker`, then translation (and scale) of least target scatter."""
    mount, seen = pairs.anchor_T_mount(), pairs.camera_T_target
    X = kronecker(mount, seen)
    scale = 1.0
    if pairs.length_sigmas:
        # R_i t + lambda R_i R c_i + t_i is the target's origin in the anchor, the same for every view.
        turned = mount[:, :3, :3]
        offset = turned @ X[:3, :3] @ seen[:, :3, 3:]
        coefficients = np.concatenate([turned, offset, np.broadcast_to(-np.eye(3), turned.shape)], axis=2)
        solved = np.linalg.lstsq(coefficients.reshape(-1, 7), -mount[:, :3, 3].reshape(-1), rcond=None)[0]
        factor = max(float(solved[3]), 1e-6)
        X, scale = transform(X[:3, :3], solved[:3]), 1 / factor
        seen = seen.copy()
        seen[:, :3, 3] *= factor
    targets = mount @ X @ seen
    return ScaledChain(
        X, transform(as_rotation(targets[:, :3, :3].mean(axis=0)), targets[:, :3, 3].mean(axis=0)), scale
    )
