"""The next pose to look from, given everything seen so far; or that enough is known."""

from dataclasses import dataclass, replace

import numpy as np

from calibration.likelihood.predicted_uncertainty import predict
from calibration.planning.plan import Plan, PlanningError, plan_poses
from calibration.planning.scene_belief import Belief, Guess, learnt
from calibration.planning.viewpoint_selection import Reachable
from calibration.planning.viewpoints import Limits, allowed, in_sight
from calibration.problem import Problem
from calibration.transforms import Array

HORIZON = 5
"""Poses planned ahead at most: more change the next one little, and cost time while the arm waits."""

RESTARTS = 2
"""A plan of which only the first pose is taken before the next plan need not be the very best."""

AS_FORESEEN = 1.1
"""A plan made before the last view was seen may give this much less than it promised."""

CAUTIONS = (1.0, 0.5, 0.25)
"""When no pose keeps the target in view whatever is true, less is taken to be possible."""


@dataclass(frozen=True, eq=False)
class Wish:
    """How many more views are allowed, and the uncertainty of a mapped point that is enough (None: use them all)."""

    views_left: int
    uncertainty_mm: float | None = None


@dataclass(frozen=True, eq=False)
class NextView:
    """`base_T_flange` (4, 4) to look from next, None when enough is known.

    `now_mm`: what the views so far tell of a mapped point, None before they determine X; `planned_mm`: what `ahead`
    more will. `belief`: what that rests on.
    """

    base_T_flange: Array | None
    now_mm: float | None
    planned_mm: float | None
    ahead: int
    belief: Belief | None = None


def next_view(
    guess: Guess,
    problem: Problem,
    limits: Limits,
    wish: Wish,
    *,
    here: Array,
    reachable: Reachable | None = None,
    misses: int = 0,
    foreseen: Plan | None = None,
) -> NextView:
    """From where to look next. `here` (4, 4): the flange now; `misses`: planned views that did not show the target.

    `foreseen`: planned before the last view was looked at; it holds unless that view has changed what is believed.
    Raises UndeterminedError, PlanningError.
    """
    caution = 1.5**misses
    belief = learnt(guess, problem, caution=caution)
    now_mm = belief.predicted_mm if np.isfinite(belief.predicted_mm) else None
    # A few residuals may be small by luck: the stated noise has to agree.
    known_mm = max(belief.reached_mm, belief.predicted_mm)
    reached = wish.uncertainty_mm is not None and known_mm <= wish.uncertainty_mm
    if reached or wish.views_left <= 0:
        return NextView(None, now_mm, None, 0)
    plan = None if foreseen is None else _still_good(foreseen, problem, limits, reachable, belief)
    if plan is None:
        plan = _plan(guess, problem, limits, wish, here, reachable, caution, belief)
    planned_mm = float(plan.predicted.point_mm) if np.isfinite(plan.predicted.point_mm) else None
    return NextView(plan.base_T_flange[0], now_mm, planned_mm, len(plan.base_T_flange), belief)


def foresee(
    found: NextView, problem: Problem, limits: Limits, wish: Wish, reachable: Reachable | None = None
) -> Plan | None:
    """What will follow the view that the arm is under way to, as if that view had shown what is expected of it.

    None where that view may change too much: before X is known. `wish` counts the view under way as well.
    """
    belief, left = found.belief, wish.views_left - 1
    if belief is None or found.base_T_flange is None or left <= 0 or not np.isfinite(belief.reached_mm):
        return None
    taken = np.concatenate([_taken(problem), found.base_T_flange[None]])
    try:
        return plan_poses(
            belief.scene, limits, min(left, HORIZON), start=found.base_T_flange, taken=taken, reachable=reachable,
            alternatives=belief.alternatives, seed=2 + len(problem.views), restarts=RESTARTS,
        )  # fmt: skip
    except PlanningError:
        return None


def _still_good(
    foreseen: Plan, problem: Problem, limits: Limits, reachable: Reachable | None, belief: Belief
) -> Plan | None:
    """The plan with what it gives now; None when its first pose is not safe any more, or it gives much less."""
    pose = foreseen.base_T_flange[:1]
    if not allowed(belief.scene, limits, pose).all() or not (reachable is None or reachable(pose).all()):
        return None
    if not all(in_sight(other, limits, pose).all() for other in belief.alternatives):
        return None
    predicted = predict(belief.scene, np.concatenate([_taken(problem), foreseen.base_T_flange]))
    if not predicted.point_mm <= AS_FORESEEN * foreseen.predicted.point_mm:
        return None
    return replace(foreseen, predicted=predicted)


def _taken(problem: Problem) -> Array:
    """Poses (n, 4, 4) from which the target was seen."""
    return np.array([view.base_T_flange for view in problem.views if view.detection is not None]).reshape(-1, 4, 4)


def _plan(
    guess: Guess,
    problem: Problem,
    limits: Limits,
    wish: Wish,
    here: Array,
    reachable: Reachable | None,
    caution: float,
    belief: Belief,
) -> Plan:
    taken = _taken(problem)
    count, seed = min(wish.views_left, HORIZON), 1 + len(problem.views)
    for share in CAUTIONS:
        wider = belief if share == 1.0 else learnt(guess, problem, caution=share * caution)
        try:
            return plan_poses(
                wider.scene, limits, count, start=here, taken=taken, reachable=reachable,
                alternatives=wider.alternatives, seed=seed, restarts=RESTARTS,
            )  # fmt: skip
        except PlanningError:
            if share == CAUTIONS[-1]:
                raise
    raise AssertionError("the last caution answers or raises")
