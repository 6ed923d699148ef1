"""Planning of calibration poses for a scene within limits, with the predicted uncertainty of X."""

from dataclasses import dataclass

import numpy as np

from calibration.errors import CalibrationError, ErrorWithFix
from calibration.likelihood.predicted_uncertainty import Scene, predict, view_information
from calibration.planning.route import visiting_order
from calibration.planning.viewpoint_selection import RESTARTS, Reachable, Search, select_viewpoints
from calibration.planning.viewpoints import ViewpointLimits, target_in_view
from calibration.sentences.sentence import Sentence
from calibration.solution import COVERAGE_FACTOR, Uncertainty
from calibration.transforms import Array

MANY_VIEWS = 6
"""Views from which a goal counts however they are spread."""


class PlanningError(CalibrationError, ErrorWithFix):
    """No set of poses satisfies the limits. `what` and `fix` are sentences for people."""


@dataclass(frozen=True, eq=False)
class Plan:
    """`base_T_flange` (n, 4, 4) in the order to visit; `target_in_view` (n,) share of the target's points in the image;
    `predicted` uncertainty, including the views taken before."""

    base_T_flange: Array
    target_in_view: Array
    predicted: Uncertainty


def plan_poses(
    scene: Scene,
    limits: ViewpointLimits,
    count: int,
    *,
    start: Array | None = None,
    taken: Array | None = None,
    reachable: Reachable | None = None,
    alternatives: tuple[Scene, ...] = (),
    goal_mm: float | None = None,
    seed: int = 1,
    restarts: int = RESTARTS,
) -> Plan:
    """The `count` poses that, with those already `taken` (m, 4, 4), determine X best.

    `start` (4, 4): the flange's pose now, from which travel counts. With `goal_mm`, a U (k = 2) at the
    worst point, at most `count` poses that lead there soonest. The target is in view in all `alternatives`, too.
    Deterministic for a given `seed`. Raises PlanningError.
    """
    known = scene.prior_information()
    if taken is not None:
        known = known + view_information(scene, taken).sum(axis=0)
    missing_views = 0 if taken is None else MANY_VIEWS - len(taken)
    goal_mm2 = None if goal_mm is None else max(goal_mm / COVERAGE_FACTOR, 1e-9) ** 2  # never 0
    rng = np.random.default_rng(seed)
    search = Search(scene, limits, reachable, rng, alternatives, start, goal_mm2, missing_views)
    chosen = select_viewpoints(search, count, known, restarts)
    poses = chosen.base_T_flange
    if len(poses) < (count if goal_mm is None else 1):
        raise PlanningError(
            Sentence("few-poses-within-limits", found=len(poses), count=count), Sentence("widen-limits")
        )
    poses = poses[visiting_order(poses, start)]
    every = poses if taken is None else np.concatenate([taken, poses])
    return Plan(poses, target_in_view(scene, poses), predict(scene, every))
