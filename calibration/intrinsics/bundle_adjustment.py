"""Least squares over a camera's intrinsics and one target pose a view, by Levenberg and Marquardt.

The poses are eliminated view by view (Schur complement), so the cost is linear in the number of views.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from calibration.linear_algebra import MIN_DETERMINED, RIDGE, scaled_pseudo_inverse, scaled_solve
from calibration.observations.observations import Observations
from calibration.observations.reprojection import RATIONAL_INTRINSICS, pixel_statistics, with_intrinsics
from calibration.observations.view_poses import apply_pose_steps
from calibration.transforms import Array

CENTRE_SIGMA_OF_SIZE = 0.05
"""Prior of the principal point about the image's centre, per axis, as a share of the image's size."""
LENS_SIGMA = (1.0, 3.0, 0.05, 0.05, 10.0, 1.0, 3.0, 10.0)
"""Prior of k1, k2, p1, p2, k3, k4, k5, k6: the range of lenses that the model describes."""
FISHEYE_SIGMA = (1.0,) * 4
"""Prior of a fisheye's k1 to k4."""
MAX_ITERATIONS, COST_TOLERANCE = 60, 1e-10
MAX_DAMPING = 1e8
ONLY_FOCAL = np.arange(RATIONAL_INTRINSICS) < 2


@dataclass(frozen=True, eq=False)
class BundleFit:
    """`poses` (n, 4, 4) camera_T_target; `covariance` (12, 12) of the intrinsics; `variance` of a pixel coordinate."""

    camera: CameraModel
    poses: Array
    covariance: Array
    variance: float


@dataclass(frozen=True, eq=False)
class _Normal:
    """The normal equations at a point: pose blocks (n, 6, 6), coupling (n, 6, k), intrinsics (k, k), and gradients."""

    cost: float
    poses: Array
    coupling: Array
    intrinsics: Array
    poses_gradient: Array
    gradient: Array
    variance: float


def adjust(
    seen: Observations, camera: CameraModel, poses: Array, free: NDArray[np.bool_], expected_lens: Array | None = None
) -> BundleFit:
    """Least-squares camera and poses, from initial `camera` and `poses` (n, 4, 4); `free` (12,) intrinsics change.

    `expected_lens`: coefficients about which the lens's prior lies, by default 0.
    """
    damping = 1e-3
    free = free & camera_has(camera)
    if expected_lens is None:
        expected_lens = np.zeros(len(camera.distortion))
    normal = _normal(seen, camera, poses, free, 1.0, expected_lens)
    for _ in range(MAX_ITERATIONS):
        step, pose_steps = _solve(normal, damping)
        change = np.zeros(RATIONAL_INTRINSICS)
        change[free] = step
        trial, trial_poses = with_intrinsics(camera, change), apply_pose_steps(poses, pose_steps)
        sane = np.all(np.isfinite(change)) and min(trial.matrix[0, 0], trial.matrix[1, 1]) > 0
        there = _normal(seen, trial, trial_poses, free, normal.variance, expected_lens) if sane else None
        if there is not None and there.cost <= normal.cost:
            settled = normal.cost - there.cost <= COST_TOLERANCE * normal.cost
            camera, poses, damping = trial, trial_poses, max(damping * 0.1, 1e-12)
            normal = _normal(seen, camera, poses, free, there.variance, expected_lens)
            if settled:
                break
        elif damping > MAX_DAMPING:
            break
        else:
            damping *= 10.0
    covariance = np.zeros((RATIONAL_INTRINSICS, RATIONAL_INTRINSICS))
    covariance[np.ix_(free, free)] = normal.variance * np.linalg.pinv(_schur(normal, 0.0)[0], hermitian=True)
    return BundleFit(camera, poses, covariance, normal.variance)


def predicted_gain(seen: Observations, camera: CameraModel, poses: Array, free: NDArray[np.bool_]) -> float:
    """By how much a linear step of the `free` (12,) intrinsics and the poses would lower the cost, in variances."""
    normal = _normal(seen, camera, poses, free & camera_has(camera), 1.0, np.zeros(len(camera.distortion)))
    own, by_gradient, _ = _schur(normal, 0.0)
    right = normal.gradient - np.einsum("nij,ni->j", normal.coupling, by_gradient)
    return float(right @ scaled_pseudo_inverse(own, MIN_DETERMINED) @ right) / max(normal.variance, 1e-300)


def focal_step(seen: Observations, camera: CameraModel, poses: Array) -> float:
    """The linear step of the logarithm of the focal length, with the poses (n, 4, 4)."""
    normal = _normal(seen, camera, poses, ONLY_FOCAL, 1.0, np.zeros(len(camera.distortion)))
    return float(np.mean(_solve(normal, 0.0)[0] / np.diagonal(camera.matrix)[:2]))


def camera_has(camera: CameraModel) -> NDArray[np.bool_]:
    """Which of the 12 intrinsics the camera's lens has."""
    return np.arange(RATIONAL_INTRINSICS) < 4 + len(camera.distortion)


def _normal(
    seen: Observations,
    camera: CameraModel,
    poses: Array,
    free: NDArray[np.bool_],
    variance: float,
    expected_lens: Array,
) -> _Normal:
    """The normal equations at a point. `variance` of a pixel coordinate weighs the prior against the pixels."""
    sums = pixel_statistics(seen, camera, poses, free_intrinsics=free)
    matrix, gradient = sums.normal, sums.gradient
    weight, off = _prior(camera, expected_lens)
    weight, off = variance * weight[free], off[free]
    square = float(sums.square.sum())
    redundancy = max(float(sums.count.sum()) - 6 * len(poses) - int(free.sum()), 1.0)
    return _Normal(
        square + float(weight @ off**2),
        matrix[:, :6, :6],
        matrix[:, :6, 6:],
        matrix[:, 6:, 6:].sum(axis=0) + np.diag(weight),
        gradient[:, :6],
        gradient[:, 6:].sum(axis=0) + weight * off,
        square / redundancy,
    )


def _prior(camera: CameraModel, expected_lens: Array) -> tuple[Array, Array]:
    """Inverse variances (12,) of the prior of the intrinsics, and the camera's deviations (12,) from its mean."""
    width, height = camera.image_size
    lens = np.array(FISHEYE_SIGMA if camera.lens_model == "fisheye" else LENS_SIGMA)[: len(camera.distortion)]
    count = 4 + len(lens)
    weight, off = np.zeros(RATIONAL_INTRINSICS), np.zeros(RATIONAL_INTRINSICS)
    weight[2:count] = 1 / np.array([CENTRE_SIGMA_OF_SIZE * width, CENTRE_SIGMA_OF_SIZE * height, *lens]) ** 2
    off[2:4] = camera.matrix[:2, 2] - (np.array([width, height]) - 1) / 2
    off[4:count] = (camera.distortion - expected_lens)[: len(lens)]
    return weight, off


def _schur(normal: _Normal, damping: float) -> tuple[Array, Array, Array]:
    """The intrinsics' own equations, and the inverse pose blocks (n, 6, 6) times gradient and coupling."""
    right_hand = np.concatenate([normal.poses_gradient[..., None], normal.coupling], axis=2)
    solved = scaled_solve(normal.poses, right_hand, damping + RIDGE)
    own = normal.intrinsics + damping * np.diag(np.diag(normal.intrinsics))
    own = own - np.einsum("nij,nik->jk", normal.coupling, solved[:, :, 1:])
    return own, solved[:, :, 0], solved[:, :, 1:]


def _solve(normal: _Normal, damping: float) -> tuple[Array, Array]:
    """Steps of the intrinsics (k,) and of the poses (n, 6)."""
    own, by_gradient, by_coupling = _schur(normal, damping)
    right = normal.gradient - np.einsum("nij,ni->j", normal.coupling, by_gradient)
    step = -scaled_pseudo_inverse(own, MIN_DETERMINED) @ right
    return step, -(by_gradient + by_coupling @ step)
