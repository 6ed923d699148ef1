"""An arm as built whose first views predict what more views will bring, and what these bring."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calibration.kinematics.arm import Arm
from calibration.problem import Problem
from calibration.solver.registered_points import registered_points
from calibration.transforms import Array, map_points
from extensions.arm_identification.mathematics.identification import ArmFit, identify_arm_session
from extensions.arm_identification.mathematics.more_views import MoreArmViews, plan_more_arm_views
from extensions.arm_identification.mathematics.views import PointsOfInterest
from mock_robot.arm.built_arm import BuiltArm, build_arm
from tests.simulated.arms import MOUNT_T_CAMERA, arm_cell, reachable_views, target_places
from tests.simulated.sessions import BOARD

FIRST_VIEWS = {1: 12, 3: 8}
"""Of each place, by the number of places of the target."""


@dataclass(frozen=True, eq=False)
class PredictedAndReached:
    """RMS error of registered points, mm, after each of the counts of more views."""

    predicted_mm: Array
    reached_mm: Array


def predict_and_reach(arm: Arm, places: int, seed: int, counts: Sequence[int]) -> PredictedAndReached | None:
    """A standard arm's registered points after so many more views; None where no errors are taken up at first."""
    rng = np.random.default_rng([seed, 7])
    targets, built = target_places(rng, arm, places), build_arm(arm, "standard", seed)
    first = [reachable_views(rng, arm, target, FIRST_VIEWS[places]) for target in targets]
    problems = arm_cell(rng, built, first, targets).problems
    fit = identify_arm_session(arm, problems)
    more = plan_more_arm_views(fit, BOARD, count=max(counts))
    if more is None:
        return None
    predicted, reached = [], []
    for count in counts:
        predicted.append(more.after_mm[count - 1] if count else more.now_mm)
        taken = [
            _seen_again(built, *session, more, count, fit, seed) for session in zip(problems, targets, strict=True)
        ]
        reached.append(_missed_mm(built, identify_arm_session(arm, taken) if count else fit, more.interest))
    return PredictedAndReached(np.array(predicted), np.array(reached))


def _seen_again(
    built: BuiltArm, problem: Problem, target: Array, more: MoreArmViews, count: int, fit: ArmFit, seed: int
) -> Problem:
    """The session of one place with those of the first `count` more views that are of that place."""
    place = int(np.argmin(np.linalg.norm(fit.anchor_T_target[:, :3, 3] - target[:3, 3], axis=1)))
    joints = more.joints_rad[:count][more.places[:count] == place]
    last = problem.views[-1].stance.joints_rad
    assert last is not None
    drawn = arm_cell(np.random.default_rng([seed, 8]), built, [np.array([last, *joints])], [target]).problems[0]
    views = [replace(view, index=len(problem.views) + row) for row, view in enumerate(drawn.views[1:])]
    return replace(problem, views=(*problem.views, *views))


def _missed_mm(built: BuiltArm, fit: ArmFit, at: PointsOfInterest) -> float:
    truth = map_points(built.base_T_flange(at.postures) @ MOUNT_T_CAMERA, at.points_mm[:, None])[:, 0]
    found, _ = registered_points(fit, at.postures, at.points_mm)
    return float(np.sqrt(np.mean(np.sum((found - truth) ** 2, axis=1))))
