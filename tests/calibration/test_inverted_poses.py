"""Poses that fit as well inverted: accepted only where something besides the views shows which are right."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from calibration.closed_forms.inverted_poses import misfit_of_inverted_poses
from calibration.problem import Problem
from calibration.solve import solve_hand_eye
from calibration.transforms import Array, inverse, rotation_from_vector, transform
from calibration.verdict import VerdictLimits, judge
from tests.simulated.spoiled_sessions import cell, error_of
from tests.simulated.varied_sessions import varied

SEED = 2
SEED_OF_ARM = 18
"""Of a session with joints whose first three views determine X."""

LIMITS = VerdictLimits().with_tolerance(10.0)
"""Above U of these few views (1 to 9 mm), so that only the reading of the poses decides."""


def bare(problem: Problem) -> Problem:
    return problem


def read_by_a_driver(problem: Problem) -> Problem:
    return replace(problem, poses_from_controller=True)


def inverted(problem: Problem) -> Problem:
    views = tuple(view.standing(base_T_flange=inverse(view.base_T_flange)) for view in problem.views)
    return replace(problem, views=views)


ROWS: dict[str, tuple[Callable[[Problem], Problem], int, bool]] = {
    "three views of a file": (bare, 3, False),
    "three inverted views of a file": (inverted, 3, False),
    "three views that a driver read": (read_by_a_driver, 3, True),
    "four views of a file": (bare, 4, True),
    "four inverted views of a file": (inverted, 4, False),
}


@pytest.mark.parametrize("setup", ["eye-in-hand", "eye-to-hand"])
@pytest.mark.parametrize("what", ROWS)
def test_few_views_are_accepted_only_as_certain(what: str, setup: str) -> None:
    change, views, accepted = ROWS[what]
    truth = cell(SEED, views, setup=setup)
    problem = change(truth.problem)
    solution = solve_hand_eye(problem)
    verdict = judge(problem, solution, LIMITS)
    errors = [finding.code for finding in verdict.findings if finding.severity == "error"]
    assert verdict.accepted is accepted
    assert views > 3 or errors == ([] if accepted else ["inverted-fits-as-well"])
    assert not accepted or error_of(solution.mount_T_camera, truth)[0] < 2


def tilted_about_the_target(views: int, rolls_rad: Array) -> Array:
    """base_T_flange of a camera at the flange, 500 mm from the target, first straight above it and then tilted."""
    base_T_target = transform(np.eye(3), [600.0, 0.0, 100.0])
    tilts = [np.zeros(3), *(0.4 * np.array([np.cos(way), np.sin(way), 0.0]) for way in np.arange(views - 1))]
    above = transform(np.diag([1.0, -1.0, -1.0]), [0.0, 0.0, 500.0])
    tilted = base_T_target @ transform(rotation_from_vector(np.array(tilts)), np.zeros(3)) @ above
    rolls = np.stack([np.zeros(views), np.zeros(views), rolls_rad], axis=1)
    return tilted @ transform(rotation_from_vector(rolls), np.zeros(3))


@pytest.mark.parametrize(("rolls_rad", "alike"), [(np.zeros(12), True), (np.arange(12.0), False)])
def test_views_tilted_about_the_target_agree_inverted_unless_the_camera_rolls(rolls_rad: Array, alike: bool) -> None:
    misfit_mm, misfit_rad = misfit_of_inverted_poses(tilted_about_the_target(12, rolls_rad))
    assert (misfit_mm < 1e-6 and misfit_rad < 1e-6) is alike
    assert alike or (misfit_mm > 10 and misfit_rad > 0.05)


@pytest.mark.parametrize(
    ("change", "joints_known", "accepted"),
    [(bare, True, True), (bare, False, False), (inverted, True, False), (inverted, False, False)],
)
def test_joints_of_a_known_arm_show_which_poses_are_right(
    change: Callable[[Problem], Problem], joints_known: bool, accepted: bool
) -> None:
    drawn = varied(np.random.default_rng(SEED_OF_ARM)).problem
    views = [view if joints_known else view.standing(joints_rad=None) for view in drawn.views[:3]]
    problem = change(replace(drawn, views=tuple(views)))
    verdict = judge(problem, solve_hand_eye(problem), LIMITS)
    assert verdict.accepted is accepted
    assert ("inverted-fits-as-well" in {finding.code for finding in verdict.findings}) is not accepted
