"""Selection of the set of viewpoints that determines X best: exchange among random candidates, then local search.

The value of a set is the predicted variance of the worst of the points that matter, the largest trace(W cov): U of
the verdict (Yang, Rebello & Waslander, arXiv:2303.06766 choose views by information as well). With a goal its cost is
the arm's time until that is met, as far as the set leaves it unmet at the set's own rate of information.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from calibration.likelihood.predicted_uncertainty import Scene, view_information
from calibration.linear_algebra import covariance_or_inf
from calibration.planning.point_criterion import point_matrices, worst_variances
from calibration.planning.route import STOP_S, lengths_with_one_more, travel_from
from calibration.planning.viewpoints import (
    ViewpointLimits,
    clip_to_limits,
    flange_poses,
    in_sight,
    random_viewpoints,
    within_limits,
)
from calibration.transforms import Array

Indices = NDArray[np.intp]

Reachable = Callable[[Array], NDArray[np.bool_]]
"""Mask (n,) of the poses base_T_flange (n, 4, 4) that the arm can take."""

POINT_VIEWPOINTS = 200
"""Viewpoints over which the place of a point of the base in the camera's frame is averaged."""

LOCAL_STEPS = np.array([0.15, 0.15, 0.3, 40.0, 0.1, 0.1])
"""First step of the local search, in the units of a viewpoint."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """Viewpoints (n, 6), the flange's poses there (n, 4, 4), and the Fisher information of each view (n, k, k)."""

    viewpoints: Array
    base_T_flange: Array
    information: Array

    def take(self, chosen: Indices) -> "Candidates":
        return Candidates(*(array[chosen] for array in vars(self).values()))

    def join(self, *others: "Candidates") -> "Candidates":
        """These, then the others."""
        parts = zip(*(vars(one).values() for one in (self, *others)), strict=True)
        return Candidates(*(np.concatenate(part) for part in parts))


@dataclass(frozen=True, eq=False)
class Search:
    """The conditions of a search. From each pose the target must be in view in all `alternatives` as well.

    `start` (4, 4): the flange's pose now, from which travel counts.
    `goal_mm2`: the variance that is enough, with at least as many as `missing_views`.
    """

    scene: Scene
    limits: ViewpointLimits
    reachable: Reachable | None
    rng: np.random.Generator
    alternatives: tuple[Scene, ...] = ()
    start: Array | None = None
    goal_mm2: float | None = None
    missing_views: int = 0

    def candidates(self, viewpoints: Array) -> Candidates:
        """Those of the viewpoints (n, 6) that are allowed and reachable."""
        poses = flange_poses(self.scene, viewpoints)
        keep = within_limits(self.scene, self.limits, poses)
        if self.reachable is not None:
            keep[keep] = self.reachable(poses[keep])
        keep[keep] = in_sight(self.alternatives, self.limits, poses[keep])
        return Candidates(viewpoints[keep], poses[keep], view_information(self.scene, poses[keep]))

    def cost(self, known: Array, others: Candidates, more: Candidates) -> Array:
        """(n,): of the sets of `others` and one of `more` beside the information `known` (k, k); seconds with a goal.

        Without one the predicted variance of the worst of the points that matter in mm², raised by the route.
        """
        information = known + others.information.sum(axis=0) + more.information
        variance = worst_variances(self._matrices, covariance_or_inf(information, 6))
        if self.start is None or self.limits.speed_mm_s is None:
            return variance
        route_mm = lengths_with_one_more(self.start, others.base_T_flange, more.base_T_flange)
        if self.goal_mm2 is None:
            return variance * (1 + COST_OF_TRAVEL_BY_MM * route_mm) ** 2
        seconds = route_mm / self.limits.speed_mm_s + STOP_S * (1 + len(others.viewpoints))
        before = 1 / worst_variances(self._matrices, covariance_or_inf(known[None], 6))
        share = (1 / self.goal_mm2 - before) / np.maximum(1 / variance - before, 1e-12)
        return seconds * np.maximum(share, max(self.missing_views / (1 + len(others.viewpoints)), 1.0))

    def cost_of(self, known: Array, chosen: Candidates) -> float:
        """The cost of one set."""
        first, rest = chosen.take(np.arange(1)), chosen.take(np.arange(1, len(chosen.viewpoints)))
        return float(self.cost(known, rest, first)[0])

    @cached_property
    def _matrices(self) -> Array:
        """Of the points that matter; those of the base where viewpoints within the limits see them."""
        viewpoints = random_viewpoints(self.limits, POINT_VIEWPOINTS, np.random.default_rng(0))
        return point_matrices(self.scene, float(np.mean(self.limits.distance_mm)), flange_poses(self.scene, viewpoints))


COST_OF_TRAVEL_BY_MM = 4e-5
"""Share of U that a millimetre of travel is worth: at 250 mm/s a metre takes 4 s, and one more view, which takes 10 s,
leaves about a tenth less."""

POOL_SIZE = 500
"""Random candidates; more of them improve a set by less than the local search does."""

RESTARTS = 8
"""Random sets from which an exchange starts; the best result goes to the local search."""

MAX_BATCHES = 40
"""Most batches of POOL_SIZE random viewpoints that are drawn; narrow limits leave few of a batch."""


def select_viewpoints(search: Search, count: int, known: Array, restarts: int) -> Candidates:
    """The `count` candidates that, together with the information `known` (k, k), leave the least variance.

    Returns fewer than `count` when the limits leave fewer candidates.
    """
    candidates = _draw_pool(search)
    if len(candidates.viewpoints) <= count:
        return candidates
    sets = [_exchange(search, candidates, count, known) for _ in range(restarts)]
    best = min(sets, key=lambda chosen: search.cost_of(known, candidates.take(chosen)))
    return _improve(search, _drop_superfluous(search, candidates.take(best), known), known)


def _drop_superfluous(search: Search, chosen: Candidates, known: Array) -> Candidates:
    """The set without the views that cost more of the arm's time than they save, one after the other."""
    while search.goal_mm2 is not None and (count := len(chosen.viewpoints)) > 1:
        fewer = [chosen.take(np.delete(np.arange(count), one)) for one in range(count)]
        costs = [search.cost_of(known, each) for each in fewer]
        if min(costs) >= search.cost_of(known, chosen):
            break
        chosen = fewer[int(np.argmin(costs))]
    return chosen


def _draw_pool(search: Search) -> Candidates:
    batches: list[Candidates] = []
    for _ in range(MAX_BATCHES):
        batches.append(search.candidates(random_viewpoints(search.limits, POOL_SIZE, search.rng)))
        if sum(len(batch.viewpoints) for batch in batches) >= POOL_SIZE / (1 if search.goal_mm2 is None else 2):
            break
    pool = batches[0].join(*batches[1:])
    if search.start is None or search.goal_mm2 is None or not len(pool.viewpoints):
        return pool
    here = pool.viewpoints[np.argmin(travel_from(search.start, pool.base_T_flange))]
    part = search.rng.random((len(pool.viewpoints), 1))
    return pool.join(search.candidates(clip_to_limits(search.limits, here + part * (pool.viewpoints - here))))


def _exchange(search: Search, candidates: Candidates, count: int, known: Array) -> Indices:
    """Indices of a set that no single exchange improves (Fedorov)."""
    chosen = search.rng.choice(len(candidates.viewpoints), count, replace=False)
    best = np.inf
    while True:
        before = best
        for slot in range(count):
            costs = search.cost(known, candidates.take(np.delete(chosen, slot)), candidates)
            costs[np.delete(chosen, slot)] = np.inf
            chosen[slot] = int(np.argmin(costs))
            best = float(costs[chosen[slot]])
        if not best < 0.99 * before:
            return chosen


def _improve(search: Search, chosen: Candidates, known: Array, rounds: int = 8, tries: int = 24) -> Candidates:
    """Local search around every viewpoint in turn, with shrinking steps."""
    for step in LOCAL_STEPS * 0.7 ** np.arange(rounds)[:, None]:
        for _ in chosen.viewpoints:
            here, others = chosen.take(np.arange(1)), chosen.take(np.arange(1, len(chosen.viewpoints)))
            around = here.viewpoints + step * search.rng.standard_normal((tries, 6))
            near = here.join(search.candidates(clip_to_limits(search.limits, around)))
            best = int(np.argmin(search.cost(known, others, near)))
            chosen = others.join(near.take(np.array([best])))
    return chosen
