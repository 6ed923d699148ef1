"""Where the target stands before a known camera, from one image.

A plane seen from far away or small has two poses that fit almost alike; both are given, the better first. Source:
Collins and Bartoli, "Infinitesimal plane-based pose estimation", 2014.
"""

from dataclasses import dataclass

import numpy as np

from calibration.camera import CameraModel
from calibration.errors import DetectionError
from calibration.observations.observations import observe
from calibration.observations.view_poses import candidate_poses
from calibration.problem import Detection, Problem, View
from calibration.targets import Target
from calibration.transforms import Array, difference

SAME_POSE_RAD = 1e-4


@dataclass(frozen=True, eq=False)
class PoseCandidate:
    """`rms_px`: distance between predicted and seen points, root of the mean square."""

    camera_T_target: Array
    rms_px: float


def target_pose(camera: CameraModel, target: Target, detection: Detection) -> tuple[PoseCandidate, ...]:
    """One or two refined poses in front of the camera, the better first.

    Raises DetectionError with the code of what is wrong with the points, or `no-pose`.
    """
    view = View(0, np.eye(4), detection)
    seen, refused = observe(Problem("eye-in-hand", target, camera, camera.image_size, (view,)))
    if refused:
        raise DetectionError(refused[0].code, refused[0].what, "bring more of the target into view")
    poses, rms_px = candidate_poses(seen, camera)
    candidates = [
        PoseCandidate(pose, float(rms))
        for pose, rms in zip(poses[0], rms_px[0], strict=True)
        if np.all(np.isfinite(pose)) and np.isfinite(rms) and (seen.points_mm[0] @ pose[2, :3] + pose[2, 3]).min() > 0
    ]
    if not candidates:
        what = "no pose of the target in front of the camera explains its points"
        raise DetectionError("no-pose", what, "check the camera's matrix and distortion, and the target's description")
    if len(candidates) == 2 and difference(*(c.camera_T_target for c in candidates))[1] < SAME_POSE_RAD:
        candidates.pop()
    return tuple(candidates)
