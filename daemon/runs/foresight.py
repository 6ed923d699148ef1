"""The poses that a run would take, and what they would tell: computed without moving anything."""

from dataclasses import dataclass

import numpy as np

from calibration.errors import UndeterminedError
from calibration.likelihood.predicted_uncertainty import predict
from calibration.planning.next_view import next_view
from calibration.planning.plan import PlanningError
from calibration.planning.scene_belief import default_camera
from calibration.problem import Problem
from calibration.transforms import Array
from daemon.cell.motion_rules import MotionRules
from daemon.config.settings import TaughtPose
from daemon.errors import NoPoses
from daemon.runs.adaptive_sequence import AdaptiveParameters

UNKNOWN_SCENE = "the first pictures of the run are small turns from where the arm stands: they find the camera's place"


@dataclass(frozen=True, eq=False)
class Foresight:
    """The poses base_T_flange (n, 4, 4), joints (6,) at each where known, and what U (k = 2, mm) would be after each.

    `predicted_mm`: at the worst of the points that matter; None before the views determine X. `note`: what was assumed,
    or why nothing is planned yet.
    """

    base_T_flange: Array
    joints_rad: list[Array | None]
    predicted_mm: tuple[float | None, ...]
    note: str


def foresee_taught(rules: MotionRules, poses: tuple[TaughtPose, ...], joints_now_rad: Array | None) -> Foresight:
    """What a run would do with these poses. Raises PoseRefused."""
    rules.check_poses(poses, joints_now_rad)
    taught = np.array([pose.transform() for pose in poses])
    return Foresight(taught, rules.joints_along(taught, joints_now_rad), (None,) * len(poses), "")


def foresee(parameters: AdaptiveParameters, base_T_flange_now: Array, joints_now_rad: Array | None) -> Foresight:
    """Plan the next poses of an adaptive run before its first view, as the run would after it. Raises NoPoses."""
    prior, rules = parameters.guess, parameters.rules
    lens = prior.camera or prior.lens_before or default_camera()
    try:
        nothing_seen = Problem(prior.setup, prior.target, prior.camera, lens.image_size, ())
        found = next_view(
            prior, nothing_seen, parameters.limits, parameters.wish, base_T_flange_now=base_T_flange_now,
            reachable=rules.reachable_from(joints_now_rad),
        )  # fmt: skip
    except UndeterminedError:
        return Foresight(np.empty((0, 4, 4)), [], (), UNKNOWN_SCENE)
    except PlanningError as error:
        raise NoPoses(error.what, error.fix) from None
    poses, belief = found.planned, found.belief
    assert poses is not None  # no views are left to take only with a wish for none
    assert belief is not None
    along = rules.joints_along(poses, joints_now_rad)
    predicted_mm = tuple(predict(belief.scene, poses[: count + 1]).expanded_mm for count in range(len(poses)))
    return Foresight(poses, along, predicted_mm, parameters.assumed)
