"""The accuracy to expect of a first calibration, planned as a run plans it, before anything of the scene is known."""

import numpy as np

from calibration.documents.knowledge import KnowledgeDocument
from calibration.documents.planning_settings import LimitsDocument, NoiseExpectedDocument
from calibration.likelihood.predicted_uncertainty import Scene
from calibration.planning.plan import PlanningError, plan_poses
from calibration.planning.scene_belief import default_camera
from calibration.problem import Setup
from calibration.transforms import transform
from daemon.tools.first_setup.answers import TargetSize

PICTURES = 8
LENS_MM = 100.0
"""From the flange to a camera on it. The robot's errors of rotation act over this and the distance to the target."""


def expected_mm(image_size: tuple[int, int], setup: Setup, size: TargetSize) -> float | None:
    """U (k = 2, mm) at the worst point of the working volume, of PICTURES planned pictures of this size (px).

    By the defaults of the settings: distances, an industrial arm's errors, a lens that is found as well. None where
    the whole target is in no such picture.
    """
    scene = Scene(
        setup,
        size.target,
        default_camera(image_size),
        mount_T_camera=transform(np.eye(3), [0.0, 0.0, LENS_MM]),
        anchor_T_target=np.eye(4),
        noise=NoiseExpectedDocument().noise(),
        intrinsics_free=True,
        knowledge=KnowledgeDocument.model_validate({"target": size.known} if size.known else {}).knowledge(),
    )
    try:
        return plan_poses(scene, LimitsDocument().limits(), PICTURES, restarts=1).predicted.worst_point.expanded_mm
    except PlanningError:
        return None
