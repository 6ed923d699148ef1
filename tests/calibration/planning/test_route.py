"""Routes: the order of poses, what one more costs, plans that travel less for nearly the same U, and to a goal."""

from itertools import pairwise

import numpy as np
import pytest

from calibration.planning import viewpoint_selection
from calibration.planning.plan import Plan, plan_poses
from calibration.planning.route import lengths_with_one_more, travel_from, visiting_order
from calibration.transforms import Array, rotation_from_vector, transform
from tests.calibration.planning.scenes import LOOK, TRUTH, WIDE


def length_mm(start: Array, poses: Array) -> float:
    route = np.concatenate([start[None], poses])
    return float(sum(travel_from(a, b[None])[0] for a, b in pairwise(route)))


def test_one_more_pose_costs_what_it_adds_where_it_adds_least() -> None:
    rng = np.random.default_rng(0)
    start, *poses = (
        transform(rotation_from_vector(rng.uniform(-1, 1, 3)), rng.uniform(-300, 300, 3)) for _ in range(10)
    )
    kept, more = np.array(poses[:4]), np.array(poses[4:])
    ordered = kept[visiting_order(kept, start)]
    for one, found in zip(more, lengths_with_one_more(start, kept, more), strict=True):
        each = [length_mm(start, np.insert(ordered, place, one, axis=0)) for place in range(5)]
        assert found == pytest.approx(min(each))


def test_a_plan_travels_less_for_nearly_the_same_uncertainty(monkeypatch: pytest.MonkeyPatch) -> None:
    def plans() -> tuple[float, float]:
        """Mean length of the routes, mm, and mean U at the worst point, mm."""
        found: list[Plan] = [
            plan_poses(TRUTH, WIDE, 5, start=LOOK, taken=LOOK[None], seed=seed, restarts=2) for seed in range(3)
        ]
        routes = [length_mm(LOOK, plan.base_T_flange) for plan in found]
        return float(np.mean(routes)), float(np.mean([plan.predicted.worst_point.expanded_mm for plan in found]))

    route_mm, expanded_mm = plans()
    monkeypatch.setattr(viewpoint_selection, "COST_OF_TRAVEL_BY_MM", 0.0)
    without_mm, least_mm = plans()
    assert route_mm < 0.9 * without_mm
    assert expanded_mm < 1.03 * least_mm


def test_poses_to_a_goal_take_less_of_the_arm_than_those_of_the_least_u() -> None:
    least = plan_poses(TRUTH, WIDE, 5, start=LOOK, taken=LOOK[None], restarts=2)
    goal_mm = 2 * least.predicted.worst_point.expanded_mm
    soonest = plan_poses(TRUTH, WIDE, 5, start=LOOK, taken=LOOK[None], restarts=2, goal_mm=goal_mm)
    assert soonest.predicted.worst_point.expanded_mm <= goal_mm
    assert length_mm(LOOK, soonest.base_T_flange) < 0.67 * length_mm(LOOK, least.base_T_flange)


@pytest.mark.parametrize("goal_mm", [1e-3, 1e-300])
def test_a_goal_beyond_reach_takes_every_pose(goal_mm: float) -> None:
    """Also one whose square is 0."""
    plan = plan_poses(TRUTH, WIDE, 4, start=LOOK, taken=LOOK[None], restarts=1, goal_mm=goal_mm)
    assert len(plan.base_T_flange) == 4
