"""The next pose to take a view from, given all views so far, or none when the stopping rule is met."""

from dataclasses import dataclass, replace

import numpy as np

from calibration.likelihood.predicted_uncertainty import predict
from calibration.planning.plan import Plan, PlanningError, plan_poses
from calibration.planning.scene_belief import SceneBelief, ScenePrior, infer_scene
from calibration.planning.viewpoint_selection import Reachable
from calibration.planning.viewpoints import ViewpointLimits, in_sight, within_limits
from calibration.problem import Problem
from calibration.transforms import Array

HORIZON = 5
"""Most poses planned ahead: more change the next one little, and cost time while the arm waits."""

RESTARTS = 2
"""Restarts of the search; few, since only the first pose of a plan is used before the next plan."""

MAX_LOSS_OF_PREPARED = 1.1
"""A plan prepared before the last view is kept while its uncertainty is at most this many times the one predicted."""

CAUTION_FACTORS = (1.0, 0.5, 0.25)
"""Factors on the caution, tried in turn while no pose keeps the target in view in all alternative scenes."""


@dataclass(frozen=True, eq=False)
class StoppingRule:
    """When to stop: after `views_left` more views, or when every stated goal is met (None stated: use all views).

    `uncertainty_mm`: RMS of a mapped point's standard deviation. `tolerance_mm`: U at the worst of the points that
    matter.
    """

    views_left: int
    uncertainty_mm: float | None = None
    tolerance_mm: float | None = None

    def met_by(self, belief: SceneBelief) -> bool:
        """True when a goal is stated, and the views so far meet every one.

        A few residuals may be small by chance, so the uncertainty at the stated noise counts as well.
        """
        goals = (
            (self.uncertainty_mm, max(belief.estimated_mm, belief.predicted_mm)),
            (self.tolerance_mm, max(belief.estimated_worst_mm, belief.predicted_worst_mm)),
        )
        stated = [known_mm <= goal_mm for goal_mm, known_mm in goals if goal_mm is not None]
        return bool(stated) and all(stated)


@dataclass(frozen=True, eq=False)
class NextView:
    """The next view.

    base_T_flange : (4, 4), None when the stopping rule is met.
    now_mm : uncertainty of a mapped point from the views so far, None before X is determined.
    planned_mm : the same after `planned_views` more views.
    belief : the scene on which the plan is based.
    planned : (planned_views, 4, 4) base_T_flange of the plan, this view first; None when the stopping rule is met.
    """

    base_T_flange: Array | None
    now_mm: float | None
    planned_mm: float | None
    planned_views: int
    belief: SceneBelief | None = None
    planned: Array | None = None


def next_view(
    prior: ScenePrior,
    problem: Problem,
    limits: ViewpointLimits,
    stop: StoppingRule,
    *,
    base_T_flange_now: Array,
    reachable: Reachable | None = None,
    misses: int = 0,
    prepared: Plan | None = None,
) -> NextView:
    """The next view to take, from the flange's pose `base_T_flange_now` (4, 4).

    `misses`: planned views without a detection so far; each widens the alternative scenes by a factor of 1.5.
    `prepared`: the result of `plan_ahead`, used if it still holds after the last view.
    Raises UndeterminedError, PlanningError.
    """
    caution = 1.5**misses
    belief = infer_scene(prior, problem, caution=caution)
    if stop.met_by(belief):
        belief = infer_scene(prior, problem, caution=caution, diagnosed=True)
    now_mm = belief.predicted_mm if np.isfinite(belief.predicted_mm) else None
    if stop.met_by(belief) or stop.views_left <= 0:
        return NextView(None, now_mm, None, 0)
    plan = None if prepared is None else _revalidate(prepared, problem, limits, reachable, belief)
    if plan is None:
        plan = _plan(prior, problem, limits, stop, base_T_flange_now, reachable, caution, belief)
    planned_mm = float(plan.predicted.point_mm) if np.isfinite(plan.predicted.point_mm) else None
    return NextView(plan.base_T_flange[0], now_mm, planned_mm, len(plan.base_T_flange), belief, plan.base_T_flange)


def plan_ahead(
    found: NextView, problem: Problem, limits: ViewpointLimits, stop: StoppingRule, reachable: Reachable | None = None
) -> Plan | None:
    """The plan after the view that the arm is moving to, computed meanwhile as if that view showed what is expected.

    None when no view is left. `stop.views_left` includes the view under way.
    """
    belief, views_left = found.belief, stop.views_left - 1
    if belief is None or found.base_T_flange is None or views_left <= 0:
        return None
    taken = np.concatenate([_poses_with_target(problem), found.base_T_flange[None]])
    try:
        return plan_poses(
            belief.scene, limits, min(views_left, HORIZON), start=found.base_T_flange, taken=taken, reachable=reachable,
            alternatives=belief.alternatives, seed=2 + len(problem.views), restarts=RESTARTS,
        )  # fmt: skip
    except PlanningError:
        return None


def _revalidate(
    prepared: Plan, problem: Problem, limits: ViewpointLimits, reachable: Reachable | None, belief: SceneBelief
) -> Plan | None:
    """The plan with its prediction updated; None when its first pose is no longer allowed, or the plan much worse."""
    pose = prepared.base_T_flange[:1]
    if not within_limits(belief.scene, limits, pose).all() or not (reachable is None or reachable(pose).all()):
        return None
    if not all(in_sight(other, limits, pose).all() for other in belief.alternatives):
        return None
    predicted = predict(belief.scene, np.concatenate([_poses_with_target(problem), prepared.base_T_flange]))
    if not predicted.worst_point.sigma_mm <= MAX_LOSS_OF_PREPARED * prepared.predicted.worst_point.sigma_mm:
        return None
    return replace(prepared, predicted=predicted)


def _poses_with_target(problem: Problem) -> Array:
    """The flange's poses (n, 4, 4) of the views in which the target was detected."""
    return np.array([view.base_T_flange for view in problem.views if view.detection is not None]).reshape(-1, 4, 4)


def _plan(
    prior: ScenePrior,
    problem: Problem,
    limits: ViewpointLimits,
    stop: StoppingRule,
    base_T_flange_now: Array,
    reachable: Reachable | None,
    caution: float,
    belief: SceneBelief,
) -> Plan:
    taken = _poses_with_target(problem)
    count, seed = min(stop.views_left, HORIZON), 1 + len(problem.views)
    for share in CAUTION_FACTORS:
        wider = belief if share == 1.0 else infer_scene(prior, problem, caution=share * caution)
        try:
            return plan_poses(
                wider.scene, limits, count, start=base_T_flange_now, taken=taken, reachable=reachable,
                alternatives=wider.alternatives, seed=seed, restarts=RESTARTS,
            )  # fmt: skip
        except PlanningError:
            if share == CAUTION_FACTORS[-1]:
                raise
    raise AssertionError("the last caution answers or raises")
