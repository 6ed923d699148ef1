"""Selection of the set of viewpoints that determines X best: exchange among random candidates, then local search.

The value of a set is the predicted variance of the worst of the points that matter, the largest trace(W cov): U of the
verdict (Yang, Rebello & Waslander, arXiv:2303.06766 choose views by information as well).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from calibration.likelihood.predicted_uncertainty import Scene, view_information
from calibration.linear_algebra import covariance_or_inf
from calibration.planning.point_criterion import point_matrices, worst_variances
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


@dataclass(frozen=True, eq=False)
class Search:
    """The conditions of a search. From each pose the target must be in view in all `alternatives` as well."""

    scene: Scene
    limits: ViewpointLimits
    reachable: Reachable | None
    rng: np.random.Generator
    alternatives: tuple[Scene, ...] = ()

    def candidates(self, viewpoints: Array) -> Candidates:
        """Those of the viewpoints (n, 6) that are allowed and reachable."""
        poses = flange_poses(self.scene, viewpoints)
        keep = within_limits(self.scene, self.limits, poses)
        if self.reachable is not None:
            keep[keep] = self.reachable(poses[keep])
        for other in self.alternatives:
            if not keep.any():
                break
            keep[keep] = in_sight(other, self.limits, poses[keep])
        return Candidates(viewpoints[keep], poses[keep], view_information(self.scene, poses[keep]))

    def variance(self, information: Array) -> Array:
        """Predicted variance (n,) of the worst of the points that matter, in mm², of information (n, k, k)."""
        return worst_variances(self._matrices, covariance_or_inf(information, 6))

    @cached_property
    def _matrices(self) -> Array:
        """Of the points that matter; those of the base where viewpoints within the limits see them."""
        viewpoints = random_viewpoints(self.limits, POINT_VIEWPOINTS, np.random.default_rng(0))
        return point_matrices(self.scene, float(np.mean(self.limits.distance_mm)), flange_poses(self.scene, viewpoints))


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
    values = search.variance(np.array([known + candidates.information[chosen].sum(axis=0) for chosen in sets]))
    return _improve(search, _take(candidates, sets[int(np.argmin(values))]), known)


def _draw_pool(search: Search) -> Candidates:
    batches: list[Candidates] = []
    for _ in range(MAX_BATCHES):
        batches.append(search.candidates(random_viewpoints(search.limits, POOL_SIZE, search.rng)))
        if sum(len(batch.viewpoints) for batch in batches) >= POOL_SIZE:
            break
    return Candidates(
        np.concatenate([batch.viewpoints for batch in batches]),
        np.concatenate([batch.base_T_flange for batch in batches]),
        np.concatenate([batch.information for batch in batches]),
    )


def _take(candidates: Candidates, chosen: Indices) -> Candidates:
    return Candidates(candidates.viewpoints[chosen], candidates.base_T_flange[chosen], candidates.information[chosen])


def _exchange(search: Search, candidates: Candidates, count: int, known: Array) -> Indices:
    """Indices of a set that no single exchange improves (Fedorov)."""
    chosen = search.rng.choice(len(candidates.viewpoints), count, replace=False)
    best = np.inf
    while True:
        before = best
        for slot in range(count):
            others = known + candidates.information[np.delete(chosen, slot)].sum(axis=0)
            values = search.variance(others + candidates.information)
            values[np.delete(chosen, slot)] = np.inf
            chosen[slot] = int(np.argmin(values))
            best = float(values[chosen[slot]])
        if not best < 0.99 * before:
            return chosen


def _improve(search: Search, chosen: Candidates, known: Array, rounds: int = 8, tries: int = 24) -> Candidates:
    """Local search around every viewpoint in turn, with shrinking steps."""
    viewpoints, poses, information = chosen.viewpoints.copy(), chosen.base_T_flange.copy(), chosen.information.copy()
    for step in LOCAL_STEPS * 0.7 ** np.arange(rounds)[:, None]:
        for slot in range(len(viewpoints)):
            around = viewpoints[slot] + step * search.rng.standard_normal((tries, 6))
            near = search.candidates(clip_to_limits(search.limits, around))
            others = known + np.delete(information, slot, axis=0).sum(axis=0)
            values = search.variance(others + np.concatenate([information[slot][None], near.information]))
            if (best := int(np.argmin(values)) - 1) >= 0:
                viewpoints[slot], poses[slot] = near.viewpoints[best], near.base_T_flange[best]
                information[slot] = near.information[best]
    return Candidates(viewpoints, poses, information)
