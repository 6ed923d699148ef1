"""What each view tells, which poses stay safe whatever is true, and when enough is known."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calibration.errors import UndeterminedError
from calibration.likelihood.predicted_uncertainty import Scene, predict
from calibration.planning.exploration import ANGLES_DEG, Exploration, turn_flange
from calibration.planning.jog_advice import advise
from calibration.planning.next_view import NextView, StoppingRule, next_view, plan_ahead
from calibration.planning.scene_belief import ScenePrior, infer_scene, sigma_points
from calibration.planning.viewpoints import flange_poses, target_in_view
from calibration.planning.what_if import PlanComparison
from calibration.solution import NamedPoint
from calibration.solve import solve_hand_eye
from calibration.transforms import (
    Array,
    difference,
    inverse,
    rotation_angle_rad,
    transform,
)
from tests.calibration.planning.scenes import (
    GOOD_NOISE,
    LOOK,
    TRUTH,
    WIDE,
    guess_off,
    problem_of,
    seed_poses,
)

pytestmark = pytest.mark.slow


def taken_step_by_step(guess: ScenePrior, wish: StoppingRule) -> tuple[list[Array], list[NextView]]:
    """The poses an arm would have taken, and what was told at each."""
    poses, told = [LOOK], []
    while True:
        told.append(next_view(guess, problem_of(poses, guess.camera), WIDE, wish, base_T_flange_now=poses[-1]))
        pose = told[-1].base_T_flange
        if pose is None:
            return poses, told
        poses.append(pose)
        wish = replace(wish, views_left=wish.views_left - 1)


@cache
def five_views() -> list[Array]:
    """Taken from a guess 5 mm and 1 degree off."""
    return taken_step_by_step(guess_off(5.0, 1.0), StoppingRule(5))[0]


def test_after_the_first_look_the_target_is_where_the_image_shows_it_for_that_x():
    belief = infer_scene(guess_off(0.0, 0.0), problem_of([LOOK]))
    shift_mm, turn_rad = difference(belief.scene.anchor_T_target, TRUTH.anchor_T_target)
    assert (shift_mm < 1.0, turn_rad < 2e-3) == (True, True)
    assert not np.isfinite(belief.estimated_mm)


def test_with_a_guess_50_mm_and_10_deg_off_the_target_stays_in_the_picture_and_the_result_is_as_good():
    """On average over four directions: which of nearly equal sets of poses a search finds scatters U by a fifth."""
    reached = []
    for direction in range(4):
        poses, told = taken_step_by_step(guess_off(50.0, 10.0, direction=direction), StoppingRule(3))
        # The farthest guesses may cost a few of the target's points in the first move, never the target.
        assert target_in_view(TRUTH, np.array(poses)).min() > 0.6
        assert told[-1].now_mm is not None
        reached.append(told[-1].now_mm)
    assert np.mean(reached) <= 0.25


def test_doubt_shrinks_with_every_view():
    poses, _ = taken_step_by_step(guess_off(20.0, 4.0), StoppingRule(3))

    def doubt(views: int) -> float:
        belief = infer_scene(guess_off(20.0, 4.0), problem_of(poses[:views]))
        return max(difference(other.mount_T_camera, belief.scene.mount_T_camera)[0] for other in belief.alternatives)

    spread = [doubt(views) for views in (1, 2, 4)]
    # Two views tell hardly more of X than one: what they leave is the guess.
    assert spread[0] > 40
    assert spread[1] < 1.001 * spread[0]
    assert spread[2] < 4


def test_a_planned_pose_keeps_the_target_in_view_in_every_scene_that_could_be_true():
    guess = guess_off(10.0, 2.0)
    belief = infer_scene(guess, problem_of([LOOK]))
    told = next_view(guess, problem_of([LOOK]), WIDE, StoppingRule(3), base_T_flange_now=LOOK)
    assert told.base_T_flange is not None
    seen = [target_in_view(other, told.base_T_flange[None])[0] for other in belief.alternatives]
    assert len(seen) == 12
    assert min(seen) == 1.0


def test_it_ends_when_a_mapped_point_is_known_as_well_as_asked():
    guess = guess_off(10.0, 2.0)
    poses, told = taken_step_by_step(guess, StoppingRule(12, tolerance_mm=0.15))
    assert 4 <= len(poses) < 12
    uncertainty = solve_hand_eye(problem_of(poses)).uncertainty
    assert uncertainty is not None
    assert uncertainty.expanded_mm is not None
    assert uncertainty.expanded_mm <= 0.15
    assert told[-1].now_mm is not None
    assert told[-2].now_mm is not None
    assert told[-1].now_mm <= 0.15 < told[-2].now_mm


def test_with_unknown_intrinsics_it_starts_from_a_usual_field_of_view():
    guess = guess_off(10.0, 2.0, intrinsics_known=False)
    poses, told = taken_step_by_step(guess, StoppingRule(4))
    assert target_in_view(TRUTH, np.array(poses)).min() > 0.6
    assert told[-1].now_mm is not None
    assert told[-1].now_mm < 0.9


@pytest.mark.parametrize("points", [(), (NamedPoint("hinge", "camera", (150.0, 0.0, 700.0)),)])
def test_what_is_told_is_u_at_the_worst_of_the_points_that_matter(points):
    guess = replace(guess_off(5.0, 1.0), points=points)
    poses, _ = taken_step_by_step(guess, StoppingRule(3))
    told = next_view(guess, problem_of(poses), WIDE, StoppingRule(2), base_T_flange_now=poses[-1])
    assert told.belief is not None and told.planned is not None
    now = predict(told.belief.scene, np.array(poses)).worst_point
    after = predict(told.belief.scene, np.concatenate([poses, told.planned])).worst_point
    assert told.now_mm == pytest.approx(2 * now.sigma_mm)
    assert told.planned_mm == pytest.approx(2 * after.sigma_mm)
    assert {now.name, after.name} == {"hinge"} if points else "hinge" not in (now.name, after.name)
    by_hand = advise(guess, problem_of(poses), WIDE, StoppingRule(2), base_T_flange_now=poses[-1])
    assert by_hand.now_mm == told.now_mm
    assert by_hand.base_T_flange is not None
    jogged = predict(told.belief.scene, np.array([*poses, by_hand.base_T_flange])).worst_point
    assert by_hand.planned_mm == pytest.approx(2 * jogged.sigma_mm)


def test_nothing_known_and_nothing_seen_is_refused():
    guess = replace(guess_off(0.0, 0.0), mount_T_camera=None)
    with pytest.raises(UndeterminedError, match="nothing says where it is"):
        infer_scene(guess, problem_of([]))
    with pytest.raises(UndeterminedError, match="turn the flange about two axes"):
        infer_scene(guess, problem_of([LOOK, turn_flange(LOOK, ("z", 15.0))]))


def test_two_small_turns_give_a_rough_x():
    guess = replace(guess_off(0.0, 0.0), mount_T_camera=None)
    poses = [LOOK, turn_flange(LOOK, ("z", 10.0)), turn_flange(LOOK, ("x", -3.0))]
    belief = infer_scene(guess, problem_of(poses))
    shift_mm, turn_rad = difference(belief.scene.mount_T_camera, TRUTH.mount_T_camera)
    assert (shift_mm < 30, turn_rad < np.radians(3)) == (True, True)


def test_exploring_reverses_a_turn_that_loses_the_target_and_stops_after_two_axes():
    exploration, turns = Exploration(), []
    while (turn := exploration.next_turn()) is not None:
        turns.append(turn)
        exploration = exploration.after(turn, seen=turn[1] < 0)
    assert turns == [("z", 15.0), ("z", -15.0), ("x", 12.0), ("x", -12.0)]
    assert exploration.is_complete


def test_exploring_gives_up_when_nothing_is_left_and_never_moves_the_flanges_origin():
    exploration, turns = Exploration(), []
    while (turn := exploration.next_turn()) is not None:
        turns.append(turn)
        exploration = exploration.after(turn, seen=False)
    assert (len(turns), exploration.is_complete) == (sum(map(len, ANGLES_DEG.values())), False)
    poses = np.array([turn_flange(LOOK, turn) for turn in turns])
    assert np.ptp(poses[:, :3, 3], axis=0).max() < 1e-9
    assert np.max(rotation_angle_rad(inverse(LOOK)[:3, :3] @ poses[:, :3, :3])) < np.radians(15.1)


def test_alternatives_lie_at_two_sigma_whichever_way_the_covariance_lies():
    covariance = np.diag([1e-3, 1e-4, 1e-4, 4.0, 100.0, 1.0])
    others = sigma_points(TRUTH.mount_T_camera, covariance)
    shifts = sorted(difference(other, TRUTH.mount_T_camera)[0] for other in others)
    assert len(others) == 12
    assert shifts[-1] == pytest.approx(2 * np.sqrt(101.0))


def test_poses_that_somebody_chose_badly_hear_what_planned_ones_would_have_given():
    def findings(scene: Scene, poses: Array) -> list[str]:
        problem = problem_of(list(poses))
        solution = solve_hand_eye(problem)
        solution = replace(solution, mount_T_camera=scene.mount_T_camera, anchor_T_target=scene.anchor_T_target)
        solution = replace(solution, camera=TRUTH.camera)
        return [finding.message for finding in PlanComparison(WIDE, GOOD_NOISE).findings(problem, solution)]

    (told,) = findings(TRUTH, seed_poses())
    assert told.startswith("3 planned poses would leave U = 0.")
    assert told.endswith("these 3 leave 34 mm")
    assert findings(TRUTH, np.array(five_views())) == []


def test_what_was_foreseen_while_the_arm_moved_is_taken_when_the_view_shows_what_was_expected():
    guess, poses = guess_off(5.0, 1.0), [LOOK]
    for _ in range(3):
        told = next_view(guess, problem_of(poses), WIDE, StoppingRule(6), base_T_flange_now=poses[-1])
        assert told.base_T_flange is not None
        poses.append(told.base_T_flange)
    before = next_view(guess, problem_of(poses), WIDE, StoppingRule(4), base_T_flange_now=poses[-1])
    foreseen = plan_ahead(before, problem_of(poses), WIDE, StoppingRule(4))
    assert foreseen is not None and before.base_T_flange is not None
    assert len(foreseen.base_T_flange) == 3
    after = [*poses, before.base_T_flange]

    told = next_view(guess, problem_of(after), WIDE, StoppingRule(3), base_T_flange_now=after[-1], prepared=foreseen)
    np.testing.assert_array_equal(told.base_T_flange, foreseen.base_T_flange[0])
    anew = next_view(guess, problem_of(after), WIDE, StoppingRule(3), base_T_flange_now=after[-1])
    assert told.planned_mm is not None and anew.planned_mm is not None
    assert told.planned_mm < 1.1 * anew.planned_mm

    elsewhere = replace(foreseen, base_T_flange=foreseen.base_T_flange @ transform(np.eye(3), [400.0, 0, 0]))
    told = next_view(guess, problem_of(after), WIDE, StoppingRule(3), base_T_flange_now=after[-1], prepared=elsewhere)
    np.testing.assert_array_equal(told.base_T_flange, anew.base_T_flange)


def test_a_view_is_foreseen_before_x_is_known_and_none_after_the_last():
    guess = guess_off(5.0, 1.0)
    first = next_view(guess, problem_of([LOOK]), WIDE, StoppingRule(4), base_T_flange_now=LOOK)
    assert first.now_mm is None
    foreseen = plan_ahead(first, problem_of([LOOK]), WIDE, StoppingRule(4))
    assert foreseen is not None
    assert len(foreseen.base_T_flange) == 3
    poses = [LOOK, first.base_T_flange]
    second = next_view(guess, problem_of(poses), WIDE, StoppingRule(3), base_T_flange_now=poses[-1], prepared=foreseen)
    np.testing.assert_array_equal(second.base_T_flange, foreseen.base_T_flange[0])

    last = next_view(guess, problem_of(poses), WIDE, StoppingRule(1), base_T_flange_now=poses[-1])
    assert plan_ahead(last, problem_of(poses), WIDE, StoppingRule(1)) is None


def test_a_run_ends_by_the_uncertainty_that_a_diagnosis_has_widened(monkeypatch):
    poses = five_views()
    guess, problem, wish = guess_off(5.0, 1.0), problem_of(poses), StoppingRule(3, uncertainty_mm=0.2)
    assert next_view(guess, problem, WIDE, wish, base_T_flange_now=poses[-1]).base_T_flange is None

    def solve_widened(problem):
        found = solve_hand_eye(problem)
        assert found.uncertainty is not None
        return replace(found, uncertainty=replace(found.uncertainty, point_mm=0.5))

    monkeypatch.setattr("calibration.solve.solve_hand_eye", solve_widened)
    assert next_view(guess, problem, WIDE, wish, base_T_flange_now=poses[-1]).base_T_flange is not None


@pytest.mark.parametrize("lens", ["refocused", "of other pictures"])
def test_the_lens_of_before_is_where_planning_begins_and_never_what_is_known(lens):
    """A run ends by what its result will say, which does not have the lens of the active calibration either."""
    before = {
        "refocused": replace(
            TRUTH.camera, matrix=TRUTH.camera.matrix * np.array([[1.01, 1, 1], [1, 1.01, 1], [1] * 3])
        ),
        "of other pictures": replace(TRUTH.camera, matrix=TRUTH.camera.matrix / 2, image_size=(640, 512)),
    }[lens]
    without = guess_off(0.0, 0.0, intrinsics_known=False)
    looks = [[0.4, 0.0, 0.0, 500.0], [-0.4, 0.1, 1.2, 700.0], [0.0, 0.5, -1.0, 600.0], [0.1, -0.5, 2.0, 550.0]]
    poses = [LOOK, *flange_poses(TRUTH, np.array([[*look, 0.0, 0.0] for look in looks]))]
    guess = replace(without, lens_before=before)
    first = infer_scene(guess, problem_of([LOOK], None))
    assert (first.scene.camera is before) == (lens == "refocused"), "of another size it says nothing of these pictures"
    belief, unknown = (infer_scene(one, problem_of(poses, None)) for one in (guess, without))
    assert belief.scene.intrinsics_free and belief.estimated_worst_mm == unknown.estimated_worst_mm
