"""The next pose to take a view from, given all views so far, or none when the stopping rule is met."""

from dataclasses import dataclass, replace

import numpy as np

from calibration.knowledge import Knowledge, TargetKnowledge
from calibration.likelihood.predicted_uncertainty import median_distance_mm, predict, view_information
from calibration.linear_algebra import covariance_or_inf
from calibration.planning.plan import MANY_VIEWS, Plan, PlanningError, plan_poses
from calibration.planning.point_criterion import point_matrices, worst_variances
from calibration.planning.scene_belief import SceneBelief, ScenePrior, infer_scene
from calibration.planning.viewpoint_selection import Reachable
from calibration.planning.viewpoints import ViewpointLimits, in_sight, within_limits
from calibration.problem import Problem
from calibration.sentences.sentence import Sentence
from calibration.solution import COVERAGE_FACTOR
from calibration.transforms import Array

MIN_VIEWS = 3
"""Least views before a goal counts."""

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

    `uncertainty_mm`: RMS of a measured point's standard deviation. `tolerance_mm`: U at the worst of the points that
    matter. Goals count from three views on, and up to five only with two distances and three rolls.
    `hurried`: whether the poses are those that lead to the tolerance soonest, else those that leave the least U.
    """

    views_left: int
    uncertainty_mm: float | None = None
    tolerance_mm: float | None = None
    hurried: bool = False

    def met_by(self, belief: SceneBelief) -> bool:
        """True when a goal is stated, and the views so far meet every one, in statement and in belief.

        A few residuals may be small by chance, so the uncertainty at the noise that is believed counts as well.
        """
        if not (belief.views >= MANY_VIEWS or (belief.views >= MIN_VIEWS and belief.varied)):
            return False
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
    now_mm : U (k = 2) at the worst of the points that matter from the views so far, None before X is determined.
    planned_mm : the same after `planned_views` more views.
    belief : the scene on which the plan is based.
    reach : what the views still left can bring, where that is not enough; None while it is, or is not known.
    planned : (planned_views, 4, 4) base_T_flange of the plan, this view first; None when the stopping rule is met.
    """

    base_T_flange: Array | None
    now_mm: float | None
    planned_mm: float | None
    planned_views: int
    belief: SceneBelief | None = None
    planned: Array | None = None
    reach: "Reach | None" = None


@dataclass(frozen=True)
class Reach:
    """U (k = 2) at the worst of the points that matter after `views` views, beyond the tolerance.

    `with_measured_target_mm`, `with_absolute_accuracy_mm`, `with_twice_the_views_mm`: what would help, and by how much.
    """

    views: int
    tolerance_mm: float
    expanded_mm: float
    with_measured_target_mm: float
    with_absolute_accuracy_mm: float
    with_twice_the_views_mm: float

    def sentence(self) -> Sentence:
        """The whole as one sentence."""
        return Sentence("tolerance-out-of-reach", **vars(self))


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
    now_mm = belief.now_mm
    if stop.met_by(belief) or stop.views_left <= 0:
        return NextView(None, now_mm, None, 0)
    plan = None if prepared is None else _revalidate(prepared, problem, limits, reachable, belief)
    if plan is None:
        plan = _plan(prior, problem, limits, stop, base_T_flange_now, reachable, caution, belief)
    planned_mm = plan.predicted.expanded_mm
    return NextView(
        plan.base_T_flange[0], now_mm, planned_mm, len(plan.base_T_flange), belief, plan.base_T_flange,
        _reach(stop, belief, _poses_with_target(problem), plan.base_T_flange),
    )  # fmt: skip


def _reach(stop: StoppingRule, belief: SceneBelief, taken: Array, planned: Array) -> Reach | None:
    """What all views that are left can bring, each as good as the planned ones; None where that is enough."""
    if stop.tolerance_mm is None or belief.views < MIN_VIEWS:
        return None
    scene, views = belief.scene, len(taken) + stop.views_left

    def expanded_mm(knowledge: Knowledge, views_left: int) -> float:
        known = replace(scene, knowledge=knowledge)
        before, more = (view_information(known, poses).sum(axis=0) for poses in (taken, planned))
        whole = known.prior_information() + before + more * views_left / len(planned)
        matrices = point_matrices(known, median_distance_mm(known, taken), taken)
        worst = worst_variances(matrices, covariance_or_inf(whole, 6)[None])
        return COVERAGE_FACTOR * float(np.sqrt(worst[0]))

    stated = scene.knowledge
    best_mm = expanded_mm(stated, stop.views_left)
    if not best_mm > stop.tolerance_mm:
        return None
    measured = replace(stated, target=TargetKnowledge("certified", 0.0))
    return Reach(
        views,
        stop.tolerance_mm,
        best_mm,
        expanded_mm(measured, stop.views_left),
        expanded_mm(replace(measured, arm="absolute-accuracy"), stop.views_left),
        expanded_mm(stated, stop.views_left + views),
    )


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
            goal_mm=_goal_mm(stop, belief),
        )  # fmt: skip
    except PlanningError:
        return None


def _goal_mm(stop: StoppingRule, belief: SceneBelief) -> float | None:
    """The U to predict, so that the one which is estimated meets the tolerance as well; None of a run in no hurry."""
    if stop.tolerance_mm is None or not stop.hurried:
        return None
    known = np.isfinite(belief.estimated_worst_mm)
    return stop.tolerance_mm * (min(1.0, belief.predicted_worst_mm / belief.estimated_worst_mm) if known else 1.0)


def _revalidate(
    prepared: Plan, problem: Problem, limits: ViewpointLimits, reachable: Reachable | None, belief: SceneBelief
) -> Plan | None:
    """The plan with its prediction updated; None when its first pose is no longer allowed, or the plan much worse."""
    pose = prepared.base_T_flange[:1]
    if not within_limits(belief.scene, limits, pose).all() or not (reachable is None or reachable(pose).all()):
        return None
    if not in_sight(belief.alternatives, limits, pose).all():
        return None
    predicted = predict(belief.scene, np.concatenate([_poses_with_target(problem), prepared.base_T_flange]))
    if not predicted.worst_point.sigma_mm <= MAX_LOSS_OF_PREPARED * prepared.predicted.worst_point.sigma_mm:
        return None
    return replace(prepared, predicted=predicted)


def _poses_with_target(problem: Problem) -> Array:
    """The flange's poses (n, 4, 4) of the views in which the target was detected."""
    return np.array([view.base_T_flange for view in problem.views if view.detection is not None]).reshape(-1, 4, 4)


def _plan(
    prior: ScenePrior, problem: Problem, limits: ViewpointLimits, stop: StoppingRule, base_T_flange_now: Array,
    reachable: Reachable | None, caution: float, belief: SceneBelief,
) -> Plan:  # fmt: skip
    taken = _poses_with_target(problem)
    count, seed = min(stop.views_left, HORIZON), 1 + len(problem.views)
    for share in CAUTION_FACTORS:
        wider = belief if share == 1.0 else infer_scene(prior, problem, caution=share * caution)
        try:
            return plan_poses(
                wider.scene, limits, count, start=base_T_flange_now, taken=taken, reachable=reachable,
                alternatives=wider.alternatives, seed=seed, restarts=RESTARTS, goal_mm=_goal_mm(stop, belief),
            )  # fmt: skip
        except PlanningError:
            if share == CAUTION_FACTORS[-1]:
                raise
    raise AssertionError("the last caution answers or raises")
