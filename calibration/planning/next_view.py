"""The next pose to look from, given everything seen so far; or that enough is known."""

from dataclasses import dataclass

import numpy as np

from calibration.planning.learning import Belief, Guess, learnt
from calibration.planning.plan import Plan, PlanningError, plan_poses
from calibration.planning.selection import Reachable
from calibration.planning.viewpoints import Limits
from calibration.problem import Problem
from calibration.transforms import Array

HORIZON = 5
"""Poses planned ahead at most: more change the next one little, and cost time while the arm waits."""

RESTARTS = 2
"""A plan of which only the first pose is taken before the next plan need not be the very best."""

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
    more will.
    """

    base_T_flange: Array | None
    now_mm: float | None
    planned_mm: float | None
    ahead: int


def next_view(
    guess: Guess,
    problem: Problem,
    limits: Limits,
    wish: Wish,
    *,
    here: Array,
    reachable: Reachable | None = None,
    misses: int = 0,
) -> NextView:
    """From where to look next. `here` (4, 4): the flange now; `misses`: planned views that did not show the target.

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
    plan = _plan(guess, problem, limits, wish, here, reachable, caution, belief)
    planned_mm = plan.predicted.point_mm
    return NextView(
        plan.base_T_flange[0], now_mm, float(planned_mm) if np.isfinite(planned_mm) else None, len(plan.base_T_flange)
    )


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
    taken = np.array([view.base_T_flange for view in problem.views if view.detection is not None]).reshape(-1, 4, 4)
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
