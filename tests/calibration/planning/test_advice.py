"""What somebody with a joystick is told: one turn or two, that keeps the target in view and tells nearly the most."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.likelihood.predicted_uncertainty import median_distance_mm
from calibration.planning.jog_advice import Advice, advise
from calibration.planning.next_view import MANY_VIEWS, StoppingRule
from calibration.planning.plan import plan_poses
from calibration.planning.scene_belief import ScenePrior, infer_scene
from calibration.planning.viewpoints import ViewpointLimits, target_in_view
from calibration.transforms import Array, inverse, rotation_from_vector, transform, vector_from_rotation
from tests.calibration.planning.scenes import LOOK, TRUTH, WIDE, guess_off, problem_of

ENDLESS = StoppingRule(100)


def jogged(here: Array, told: Advice, rng: np.random.Generator) -> Array:
    """As near as a person gets; a turn without a pose is made where the arm stands."""
    if told.base_T_flange is None:
        axis = told.instruction.split("about its ")[1][0]
        turn = np.radians(12.0) * np.array([axis == "x", axis == "y", axis == "z"], float)
        return here @ transform(rotation_from_vector(turn), np.zeros(3))
    off = transform(rotation_from_vector(np.radians(2.0) * rng.standard_normal(3)), 8.0 * rng.standard_normal(3))
    return told.base_T_flange @ off


def taken_by_hand(guess: ScenePrior, views: int, seed: int = 0) -> tuple[list[Array], list[Advice]]:
    rng, poses, told = np.random.default_rng(seed), [LOOK], []
    while len(poses) < views:
        told.append(advise(guess, problem_of(poses, guess.camera), WIDE, ENDLESS, base_T_flange_now=poses[-1]))
        poses.append(jogged(poses[-1], told[-1], rng))
    return poses, told


def test_five_views_by_hand_are_worth_five_that_a_planner_chose() -> None:
    poses, told = taken_by_hand(guess_off(30.0, 5.0), 5)
    assert target_in_view(TRUTH, np.array(poses)).min() > 0.9
    known = infer_scene(guess_off(0.0, 0.0), problem_of(poses)).predicted_mm
    planned = plan_poses(TRUTH, WIDE, 5, restarts=1).predicted.point_mm
    assert known < 2.0 * planned
    assert [advice.now_mm for advice in told[:2]] == [None, None]
    assert told[-1].planned_mm is not None and told[-1].now_mm is not None
    assert told[-1].planned_mm < told[-1].now_mm


def test_views_by_hand_are_near_and_far() -> None:
    """At one distance the focal length, the target's size and X cannot be told apart."""
    poses, _ = taken_by_hand(guess_off(10.0, 2.0), 4)
    away_mm = [median_distance_mm(TRUTH, pose[None]) for pose in poses]
    assert max(away_mm) > 1.3 * min(away_mm)


def test_the_words_are_the_pose() -> None:
    told = advise(guess_off(0.0, 0.0), problem_of([LOOK]), WIDE, ENDLESS, base_T_flange_now=LOOK)
    assert told.base_T_flange is not None
    turn = np.degrees(vector_from_rotation((inverse(LOOK) @ told.base_T_flange)[None, :3, :3])[0])
    axis = int(np.argmax(np.abs(turn)))
    assert f"turn the flange by {turn[axis]:+.0f} deg about its {'xyz'[axis]}, and move it by" in told.instruction
    np.testing.assert_allclose(np.delete(turn, axis), 0.0, atol=1e-6)
    shift = ", ".join(f"{value:+.0f}" for value in told.base_T_flange[:3, 3] - LOOK[:3, 3])
    assert f"({shift}) mm in the base" in told.instruction


def test_with_nothing_known_it_names_axes_that_were_not_turned_about() -> None:
    nothing = replace(guess_off(0.0, 0.0), mount_T_camera=None)
    _, told = taken_by_hand(nothing, 4)
    assert "about its z" in told[0].instruction
    assert "about its z" not in told[1].instruction
    assert [advice.base_T_flange is None for advice in told] == [True, True, False]


@pytest.mark.parametrize(("uncertainty_mm", "enough"), [(5.0, True), (1e-4, False)])
def test_it_says_when_enough_is_known_and_how_to_go_on(uncertainty_mm: float, enough: bool) -> None:
    poses, _ = taken_by_hand(guess_off(10.0, 2.0), MANY_VIEWS)
    told = advise(
        guess_off(10.0, 2.0), problem_of(poses), WIDE, StoppingRule(0, uncertainty_mm), base_T_flange_now=poses[-1]
    )
    assert told.instruction.startswith("that is enough: finish the run; or go on: turn the flange by") is enough
    assert told.base_T_flange is not None


def test_where_no_pose_is_within_the_limits_it_says_which_axes_to_turn_about() -> None:
    narrow = ViewpointLimits(WIDE.tilt_rad, WIDE.roll_rad, WIDE.distance_mm, np.array([[9000.0] * 3, [9001.0] * 3]))
    told = advise(guess_off(0.0, 0.0), problem_of([LOOK]), narrow, ENDLESS, base_T_flange_now=LOOK)
    assert told.base_T_flange is None
    assert "by 20 deg or more about its" in told.instruction
    unreachable = advise(
        guess_off(0.0, 0.0),
        problem_of([LOOK]),
        WIDE,
        ENDLESS,
        base_T_flange_now=LOOK,
        reachable=lambda poses: np.zeros(len(poses), bool),
    )
    assert unreachable.base_T_flange is None
