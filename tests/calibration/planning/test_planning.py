"""Planned poses keep the limits, and determine X as no taught ones do."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calibration.likelihood.predicted_uncertainty import predict
from calibration.planning.plan import PlanningError, plan_poses
from calibration.planning.route import visiting_order
from calibration.planning.viewpoints import (
    ViewpointLimits,
    camera_T_target,
    flange_poses,
    random_viewpoints,
    target_in_view,
)
from calibration.transforms import map_points
from tests.calibration.planning.scenes import WIDE, seed_poses, seed_scene

pytestmark = pytest.mark.slow


def test_three_planned_poses_beat_the_seeds_by_a_factor_of_a_hundred():
    scene = seed_scene()
    planned = plan_poses(scene, WIDE, 3)
    assert planned.predicted.point_mm <= 0.17
    assert predict(scene, seed_poses()).point_mm > 100 * planned.predicted.point_mm


def test_the_same_question_has_the_same_answer():
    first, second = (plan_poses(seed_scene(), WIDE, 4) for _ in range(2))
    np.testing.assert_array_equal(first.base_T_flange, second.base_T_flange)


def test_more_poses_never_determine_less():
    uncertainties = [plan_poses(seed_scene(), WIDE, count).predicted.point_mm for count in (3, 5, 8, 12)]
    assert uncertainties == sorted(uncertainties, reverse=True)


@settings(max_examples=8, deadline=None)
@given(
    tilt_deg=st.floats(15, 60),
    roll_deg=st.floats(5, 180),
    nearest=st.floats(450, 600),
    depth=st.floats(50, 300),
    setup=st.sampled_from(["eye-in-hand", "eye-to-hand"]),
)
def test_a_plan_keeps_its_limits(tilt_deg, roll_deg, nearest, depth, setup):
    scene = replace(seed_scene(), setup=setup)
    limits = ViewpointLimits(float(np.deg2rad(tilt_deg)), float(np.deg2rad(roll_deg)), (nearest, nearest + depth))
    plan = plan_poses(scene, limits, 4)
    views = scene.camera_T_target(plan.base_T_flange)
    centre = map_points(views, scene.target.points_mm.mean(axis=0, keepdims=True))[:, 0]
    distance = np.linalg.norm(centre, axis=1)
    tilt = np.arccos(np.clip(np.einsum("ni,ni->n", views[:, :3, 2], centre / distance[:, None]), -1, 1))
    assert np.all(plan.target_in_view == 1.0)
    assert np.all(tilt <= limits.tilt_rad + 1e-6)
    assert np.all((distance >= nearest - 1e-6) & (distance <= nearest + depth + 1e-6))


def test_the_flange_stays_in_the_box():
    scene = seed_scene()
    everywhere = flange_poses(scene, random_viewpoints(WIDE, 200, np.random.default_rng(1)))[:, :3, 3]
    box = np.array([np.quantile(everywhere, 0.2, axis=0), np.quantile(everywhere, 0.8, axis=0)])
    plan = plan_poses(scene, replace(WIDE, box_mm=box), 4)
    origins = plan.base_T_flange[:, :3, 3]
    assert np.all((origins >= box[0]) & (origins <= box[1]))


def test_unreachable_poses_are_not_planned():
    scene = seed_scene()
    plan = plan_poses(scene, WIDE, 4, reachable=lambda base_T_flange: base_T_flange[:, 0, 3] > 0)
    assert np.all(plan.base_T_flange[:, 0, 3] > 0)


@pytest.mark.parametrize("alternatives", [(), (seed_scene(),)], ids=["alone", "with an alternative scene"])
def test_limits_that_allow_nothing_are_refused_with_what_to_do(alternatives):
    nowhere = replace(WIDE, box_mm=np.array([[5000.0, 5000, 5000], [5001, 5001, 5001]]))
    with pytest.raises(PlanningError, match=r"only 0 of 3 poses .* widen tilt"):
        plan_poses(seed_scene(), nowhere, 3, alternatives=alternatives)


def test_views_already_taken_are_built_upon():
    scene = seed_scene()
    taken = seed_poses()
    plan = plan_poses(scene, WIDE, 1, taken=taken)
    assert plan.predicted.point_mm < 0.02 * predict(scene, taken).point_mm


def test_a_viewpoint_puts_the_target_where_it_says():
    scene = seed_scene()
    viewpoints = random_viewpoints(WIDE, 50, np.random.default_rng(5))
    views = camera_T_target(scene, viewpoints)
    np.testing.assert_allclose(scene.camera_T_target(flange_poses(scene, viewpoints)), views, atol=1e-9)
    centre = map_points(views, scene.target.points_mm.mean(axis=0, keepdims=True))[:, 0]
    aim = scene.camera.project(centre) / (np.array(scene.camera.image_size) - 1) * 2 - 1
    np.testing.assert_allclose(aim, viewpoints[:, 4:], atol=1e-6)
    assert np.all(target_in_view(scene, flange_poses(scene, viewpoints)) > 0)


def test_the_route_is_no_longer_than_any_shuffled_one():
    poses = flange_poses(seed_scene(), random_viewpoints(WIDE, 7, np.random.default_rng(2)))
    rng = np.random.default_rng(0)

    def length(order):
        return np.linalg.norm(np.diff(poses[order][:, :3, 3], axis=0), axis=1).sum()

    shuffled = [length(rng.permutation(7)) for _ in range(50)]
    order = visiting_order(poses, start=poses[3])
    assert order[0] == 3
    assert sorted(order) == list(range(7))
    assert length(order) < np.median(shuffled)
