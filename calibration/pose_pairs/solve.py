"""X from pairs of poses alone, for sources that give no pixels: trackers, odometry, another program's detections.

Maximum likelihood over X, the target's pose, a scale where the camera has none, and the noise: the kind of camera
(`calibration.pose_pairs.noise_models`), the levels of its errors and the robot's, and the weight of their tails.
Views that disagree are left out. Motions that do not determine X are refused.
"""

import numpy as np
from numpy.typing import NDArray

from calibration.closed_forms.observability import require_observable
from calibration.errors import UndeterminedError
from calibration.pose_pairs.independent_noise import PoseFit, distances_of, fit_independent_noise, outlier_limit
from calibration.pose_pairs.noise_marginalisation import marginalise_few
from calibration.pose_pairs.noise_models import cameras_of
from calibration.pose_pairs.random_walk_noise import MIN_VIEWS, with_random_walk
from calibration.pose_pairs.residuals import PosePairs, initial_chain
from calibration.sentences.sentence import Sentence
from calibration.solver.least_median import agreeing_views
from calibration.transforms import Array

MAX_ROUNDS = 4
REACH_MM = 100.0
"""Half the side of the square of points about the target's origin in which distances between views are measured."""

MIN_VOTERS = 6
"""Least views for a vote: of five, three are a majority that always agrees with itself."""

TAILS = (np.inf, 4.0)

MAX_SCALE_SIGMA = 0.1
"""Largest standard deviation of the scale, relative; beyond it X's translation is not determined."""


def fit_pose_pairs(pairs: PosePairs) -> tuple[PoseFit, NDArray[np.bool_]]:
    """The most likely chain and noise, and the mask (n,) of the views that agree. Raises UndeterminedError."""
    _require_poses(pairs.base_T_flange, pairs.camera_T_target)
    used = _agreeing(pairs)
    for _ in range(MAX_ROUNDS):
        require_observable(pairs.base_T_flange[used])
        likeliest = _likeliest(pairs.take(used))
        distances = distances_of(pairs, likeliest)
        agreeing = distances < outlier_limit(likeliest.tail_dof, int(used.sum()))
        if np.array_equal(agreeing, used) or agreeing.sum() <= len(used) // 2:
            break
        used = agreeing
    likeliest = marginalise_few(pairs.take(used), with_random_walk(pairs.take(used), likeliest))
    if pairs.length_sigmas and not np.sqrt(likeliest.covariance[12, 12]) < MAX_SCALE_SIGMA:
        raise UndeterminedError("scale-undetermined", Sentence("camera-hardly-moves"), Sentence("move-camera-further"))
    return likeliest, used


def _likeliest(pairs: PosePairs) -> PoseFit:
    start = initial_chain(pairs)
    tails = TAILS if len(pairs) >= MIN_VIEWS else TAILS[:1]
    fitted = [fit_independent_noise(pairs, start, camera, t) for camera in cameras_of(pairs) for t in tails]
    return max(fitted, key=lambda one: one.evidence(len(pairs)))


def _agreeing(pairs: PosePairs) -> NDArray[np.bool_]:
    if len(pairs) < MIN_VOTERS:
        return np.ones(len(pairs), bool)
    seen = pairs.camera_T_target
    if pairs.length_sigmas:
        seen = seen.copy()
        seen[:, :3, 3] /= initial_chain(pairs).scale
    points = REACH_MM * np.array([[-1.0, -1, 0], [1, -1, 0], [-1, 1, 0], [1, 1, 0]])
    return agreeing_views(pairs.anchor_T_mount(), seen, points)


def _require_poses(base_T_flange: Array, camera_T_target: Array) -> None:
    if base_T_flange.shape != camera_T_target.shape or base_T_flange.shape[1:] != (4, 4):
        raise ValueError(
            f"as many poses (n, 4, 4) of the robot as of the camera: {base_T_flange.shape} and {camera_T_target.shape}"
        )
    for name, poses in (("robot", base_T_flange), ("camera", camera_T_target)):
        wrong = np.flatnonzero(~np.isfinite(poses).all(axis=(1, 2)))
        if len(wrong):
            what = Sentence(f"{name}-pose-not-finite", row=int(wrong[0]))
            raise UndeterminedError("bad-pose", what, Sentence("leave-pose-out"))
    require_observable(base_T_flange)
