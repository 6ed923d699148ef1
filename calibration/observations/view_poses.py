"""The target's pose in the camera in every view, from the pixels of that view alone.

A plane seen from far away, or a small one, has two poses that fit almost equally well; both are returned, the better
first. Source: Collins and Bartoli, "Infinitesimal plane-based pose estimation", 2014.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from calibration.camera import CameraModel
from calibration.errors import DetectionError
from calibration.kinematics.stance import Stance
from calibration.linear_algebra import scaled_solve
from calibration.observations.observations import MIN_CORNERS, Observations, observe
from calibration.observations.reprojection import pixel_residuals, pixel_statistics
from calibration.problem import Detection, Problem, View
from calibration.sentences.sentence import Sentence
from calibration.targets import Target
from calibration.transforms import Array, difference, rotation_from_vector, transform, transform_from_vector

SAME_POSE_RAD = 1e-4


@dataclass(frozen=True, eq=False)
class PoseCandidate:
    """A pose (4, 4) and its RMS distance in px between predicted and measured points."""

    camera_T_target: Array
    rms_px: float


def target_pose(camera: CameraModel, target: Target, detection: Detection) -> tuple[PoseCandidate, ...]:
    """One or two refined poses in front of the camera, the better first.

    Raises DetectionError with the code of `observe` for unusable points, or `no-pose`.
    """
    view = View(0, Stance(np.eye(4)), detection)
    seen, refused = observe(Problem("eye-in-hand", target, camera, camera.image_size, (view,)))
    if refused:
        raise DetectionError(refused[0].code, refused[0].what, Sentence("see-more"))
    poses, rms_px = candidate_poses(seen, camera)
    candidates = [
        PoseCandidate(pose, float(rms))
        for pose, rms in zip(poses[0], rms_px[0], strict=True)
        if np.all(np.isfinite(pose)) and np.isfinite(rms) and (seen.points_mm[0] @ pose[2, :3] + pose[2, 3]).min() > 0
    ]
    if not candidates:
        raise DetectionError("no-pose", Sentence("seen-no-pose"), Sentence("see-intrinsics"))
    if len(candidates) == 2 and difference(*(c.camera_T_target for c in candidates))[1] < SAME_POSE_RAD:
        candidates.pop()
    return tuple(candidates)


def apply_pose_steps(a_T_b: Array, step: Array) -> Array:
    """exp(step) @ a_T_b for steps (n, 6) of [rotation rad, translation mm]."""
    return transform_from_vector(step) @ a_T_b


def candidate_poses(seen: Observations, camera: CameraModel) -> tuple[Array, Array]:
    """The two poses camera_T_target (n, 2, 4, 4) that a plane allows, and their RMS errors (n, 2) in px.

    The better is first. A pose that is much worse before refinement is not refined.
    """
    n = len(seen)
    poses = _ippe_poses(seen, camera.normalise(seen.pixels.reshape(-1, 2)).reshape(seen.pixels.shape))
    errors = _rms(seen.take(np.repeat(np.arange(n), 2)), camera, poses.reshape(-1, 4, 4)).reshape(n, 2)
    possible = errors <= MAX_ERROR_RATIO * errors.min(axis=1, keepdims=True) + MAX_EXTRA_ERROR_PX
    rows, which = np.nonzero(possible)
    views = seen if np.array_equal(rows, np.arange(n)) else seen.take(rows)
    refined = refine_poses(views, camera, poses[rows, which])
    poses[rows, which], errors[rows, which] = refined, _rms(views, camera, refined)
    order = np.argsort(errors, axis=1)
    return np.take_along_axis(poses, order[:, :, None, None], axis=1), np.take_along_axis(errors, order, axis=1)


MAX_ERROR_RATIO, MAX_EXTRA_ERROR_PX = 5.0, 3.0
"""A pose is refined while its error is at most the better one's times the first plus the second number."""


def _rms(seen: Observations, camera: CameraModel, poses: Array) -> Array:
    squares = np.sum(pixel_residuals(seen, camera, poses) ** 2, axis=-1)
    rms: Array = np.sqrt(np.sum(seen.weights * squares, axis=1) / np.count_nonzero(seen.weights, axis=1))
    return rms


FALLBACK_POSE = transform(np.eye(3), [0.0, 0.0, 1000.0])
"""The pose of a target without a solution; its large errors exclude the view."""


def _ippe_poses(seen: Observations, xy: Array) -> Array:
    """The two poses (n, 2, 4, 4) by Collins & Bartoli's IPPE, from ideal coordinates xy (n, m, 2)."""
    used = (seen.weights > 0) & np.all(np.isfinite(xy), axis=2)
    turns, places, found = np.zeros((len(seen), 2, 3)), np.zeros((len(seen), 2, 3)), np.zeros(len(seen), bool)
    for row in np.flatnonzero(np.count_nonzero(used, axis=1) >= MIN_CORNERS):
        chosen = used[row]
        for method in PLANAR_METHODS:
            try:
                _, rotations, translations, _ = cv2.solvePnPGeneric(
                    seen.points_mm[row, chosen], xy[row, chosen], IDEAL_CAMERA_MATRIX, None, flags=method
                )
            except cv2.error:  # an assertion of OpenCV about points that no lens gives
                continue
            if len(rotations) and np.all(np.isfinite([*rotations, *translations])):
                found[row] = True
                turns[row] = rotations[0][:, 0], rotations[-1][:, 0]
                places[row] = translations[0][:, 0], translations[-1][:, 0]
                break
    poses = np.broadcast_to(FALLBACK_POSE, (len(seen), 2, 4, 4)).copy()
    poses[found] = transform(rotation_from_vector(turns[found]), places[found])
    return poses


IDEAL_CAMERA_MATRIX = np.eye(3)
"""Camera matrix of ideal normalised coordinates."""

PLANAR_METHODS = (cv2.SOLVEPNP_IPPE, cv2.SOLVEPNP_ITERATIVE)
"""OpenCV's IPPE gives NaN for 3 % of exact data of some views; the second finds one of the two poses then."""


STEP_TOLERANCE = 1e-7
"""rad, mm: the refinement ends when the largest step is shorter."""


def poses_by_lens(seen: Observations, camera: CameraModel, before: CameraModel, camera_T_target: Array) -> Array:
    """As `refine_poses`, from poses by the camera `before`: distances follow the focal length."""
    poses = camera_T_target.copy()
    poses[:, 2, 3] *= camera.matrix[0, 0] / before.matrix[0, 0]
    return refine_poses(seen, camera, poses)


def refine_poses(seen: Observations, camera: CameraModel, camera_T_target: Array, iterations: int = 6) -> Array:
    """The poses (n, 4, 4) that minimise each view's reprojection error, by Gauss-Newton from the given ones."""
    before = 0.0
    for _ in range(iterations):
        statistics = pixel_statistics(seen, camera, camera_T_target)
        step = -scaled_solve(statistics.normal, statistics.gradient[..., None])[..., 0]
        camera_T_target = apply_pose_steps(camera_T_target, step)
        longest = float(np.max(np.abs(step), initial=0.0))
        # Gauss-Newton converges linearly: the ratio of the last two steps predicts the length of the next.
        if longest < STEP_TOLERANCE or (longest < before and longest**2 < STEP_TOLERANCE * before):
            break
        before = longest
    return camera_T_target
