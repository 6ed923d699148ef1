"""The evidence of a session's images on its robot poses, before these are known."""

import numpy as np

from calibration.diagnosis.diagnose import MAX_VIEWS, evenly_spaced
from calibration.diagnosis.evidence import Evidence, evidence_of
from calibration.diagnosis.measured import measured_evidence
from calibration.errors import UndeterminedError
from calibration.intrinsics.estimate import estimate_camera
from calibration.observations.measured_poses import measured_views
from calibration.observations.observations import observe
from calibration.observations.view_poses import candidate_poses
from calibration.pose_pairs.session import covariance_or_usual
from calibration.problem import Problem

MIN_AMBIGUITY_RATIO = 1.5
"""A view whose second pose fits the plane almost as well as the first says little, and may say wrong."""

MIN_CLEAR_VIEWS = 6
"""So many clear views suffice without the ambiguous ones."""


def evidence_of_views(problem: Problem) -> Evidence | None:
    """The target's pose in the camera of every view, with its covariance; None when no camera can be estimated."""
    if problem.in_space:
        return _in_space(problem)
    seen, _ = observe(problem)
    if len(seen) == 0:
        return None
    camera = problem.camera
    if camera is None:
        detections = [view.detection for view in problem.views if view.detection is not None]
        few = [detections[row] for row in evenly_spaced(len(detections), MAX_VIEWS)]
        try:
            camera = estimate_camera(problem.target, few, problem.image_size).camera
        except UndeterminedError:
            return None
    poses, errors_px = candidate_poses(seen, camera)
    evidence = evidence_of(problem, seen, camera, poses[:, 0])
    clear = errors_px[:, 1] > MIN_AMBIGUITY_RATIO * errors_px[:, 0]
    return evidence.take(clear) if np.count_nonzero(clear) >= MIN_CLEAR_VIEWS else evidence


def _in_space(problem: Problem) -> Evidence | None:
    try:
        seen, _ = measured_views(problem)
    except UndeterminedError:
        return None
    return measured_evidence(problem, seen, covariance_or_usual(seen))
