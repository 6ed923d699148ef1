"""A contradiction weighs what it does to a mapped point."""

import numpy as np
import pytest

from calibration.problem import Problem, Setup
from calibration.solve import solve_hand_eye
from calibration.verdict import Verdict, VerdictLimits, judge
from tests.simulated.fault_kinds import GROSS
from tests.simulated.faults import Noise, moved, simulated_session
from tests.simulated.imperfect_sessions import IMPERFECTIONS, imperfect_cell

CHANGES_OF_X: dict[Setup, str] = {"eye-in-hand": "tool", "eye-to-hand": "base"}
"""The side that is moved when the camera's mount slips."""

EXACT = Noise(0.05, 0.0, 0.0)


def moved_camera(size_mm: float, setup: Setup, seed: int = 3) -> Problem:
    """A session of an exact robot in whose middle the camera's mount slips by this much."""
    clean = simulated_session(np.random.default_rng(seed), 20, EXACT, setup)
    return moved(clean, np.random.default_rng(seed), CHANGES_OF_X[setup]).at(size_mm).problem


def judged(problem: Problem, limits: VerdictLimits | None = None) -> Verdict:
    return judge(problem, solve_hand_eye(problem), limits or VerdictLimits())


@pytest.mark.parametrize("setup", CHANGES_OF_X)
def test_a_certain_change_that_moves_next_to_nothing_is_information_with_its_size(setup: Setup) -> None:
    problem = moved_camera(0.17, setup)
    solution = solve_hand_eye(problem)
    verdict = judge(problem, solution)
    found = [finding for finding in verdict.findings if finding.effect_mm is not None]
    assert found and all(finding.severity == "info" for finding in found), verdict.findings
    assert all("mapped point moves by" in finding.message for finding in found)
    assert verdict.accepted
    assert solution.uncertainty is not None and found[0].effect_mm is not None
    assert found[0].effect_mm <= 2 * solution.uncertainty.point_mm


@pytest.mark.slow
@pytest.mark.parametrize("setup", CHANGES_OF_X)
def test_the_same_change_is_an_error_beside_a_small_tolerance_and_a_large_one_beside_any(setup: Setup) -> None:
    assert not judged(moved_camera(0.5, setup), VerdictLimits().with_tolerance(0.2)).accepted
    assert not judged(moved_camera(12.0, setup)).accepted


def test_the_solutions_own_camera_is_no_effect_of_a_change() -> None:
    """Estimated with the robot's help the camera differs from that of the diagnosis, and X with it, by 1.4 mm here."""
    problem = imperfect_cell((5077, 4, 186), IMPERFECTIONS["exact robot"]).cell.problem
    slipped = moved(problem, np.random.default_rng(3), CHANGES_OF_X[problem.setup]).at(1.0).problem
    effects_mm = [finding.effect_mm for finding in solve_hand_eye(slipped).findings if finding.effect_mm is not None]
    assert effects_mm == [pytest.approx(1.0, abs=0.3)]


def test_another_reading_of_all_poses_has_no_effect_to_weigh() -> None:
    clean = simulated_session(np.random.default_rng(1), 12, Noise(), "eye-in-hand")
    fault = GROSS["poses-in-metres"](clean, np.random.default_rng(0))
    errors = [finding for finding in judged(fault.problem).findings if finding.code == "poses-in-metres"]
    assert [(finding.severity, finding.effect_mm) for finding in errors] == [("error", None)]
