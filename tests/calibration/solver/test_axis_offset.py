"""Turns about one axis and the coordinate along it, measured otherwise, give X with the uncertainty it deserves.

`pytest -s tests/calibration/solver/test_axis_offset.py` prints the normalised errors.
"""

from dataclasses import replace
from functools import cache
from typing import Literal

import numpy as np
import pytest

from calibration.documents.calibration import CalibrationDocument, calibration_document
from calibration.likelihood.predicted_uncertainty import ExpectedNoise
from calibration.planning.jog_advice import advise
from calibration.planning.next_view import StoppingRule
from calibration.planning.scene_belief import ScenePrior
from calibration.planning.viewpoints import ViewpointLimits
from calibration.planning.what_if import PlanComparison
from calibration.problem import AxisOffset, Problem, Setup
from calibration.solution import Solution
from calibration.solve import solve_hand_eye
from calibration.transforms import Array, inverse, vector_from_transform
from calibration.verdict import DEFAULT_VERDICT_LIMITS, judge
from tests.simulated.palletisers import palletiser_cell
from tests.simulated.sessions import Cell, CellNoise, random_cell
from tests.support.cases import seeds

Of = Literal["camera", "target"]
SIGMA_MM = 0.2
NOISE = ExpectedNoise(0.05, 1e-4, 0.05)

cell_of = cache(palletiser_cell)


def measured(cell: Cell, of: Of, off_mm: float = 0.0) -> Problem:
    """The session with the coordinate as it was measured, `off_mm` from the truth."""
    true = cell.mount_T_camera if of == "camera" else cell.anchor_T_target
    offset = AxisOffset(of, float(true[2, 3]) + off_mm, SIGMA_MM)
    return replace(cell.problem, axis_offset=offset, poses_from_controller=True)


@cache
def measured_camera() -> tuple[Problem, Solution]:
    """A session with the camera's coordinate as it is, and its solution."""
    problem = measured(cell_of(1, "eye-in-hand"), "camera")
    return problem, solve_hand_eye(problem)


def normalised_error(cell: Cell, solution: Solution) -> float:
    """Mean square of the six errors of X in standard deviations."""
    assert solution.mount_T_camera is not None and solution.uncertainty is not None
    error = vector_from_transform(inverse(cell.mount_T_camera) @ solution.mount_T_camera)
    return float(error @ np.linalg.solve(solution.uncertainty.covariance, error)) / 6


@pytest.mark.parametrize("of", ["camera", "target"])
@pytest.mark.parametrize("setup", ["eye-in-hand", "eye-to-hand"])
def test_x_is_found_with_the_uncertainty_of_the_number(setup: Setup, of: Of) -> None:
    cell = cell_of(1, setup)
    solution = solve_hand_eye(problem := measured(cell, of, SIGMA_MM))
    verdict = judge(problem, solution)
    assert verdict.accepted
    assert [finding.code for finding in verdict.findings] == ["axis-offset-given"]
    assert f"{problem.axis_offset and problem.axis_offset.coordinate_mm:.2f} mm" in verdict.findings[0].message
    assert "the base's z" in verdict.findings[0].message or "the flange's z" in verdict.findings[0].message
    assert normalised_error(cell, solution) < 2.1  # chi-square of six: 97.5 %
    assert solution.uncertainty is not None and solution.mount_T_camera is not None
    off = solution.mount_T_camera[:3, 3] - cell.mount_T_camera[:3, 3]
    assert np.abs(off[:2]).max() < 0.3
    along_axis_mm = solution.uncertainty.translation_mm[2]
    if of == "camera":
        assert along_axis_mm == pytest.approx(SIGMA_MM, rel=0.1)
    else:  # the distance from the target adds what lens and print leave open
        assert SIGMA_MM < along_axis_mm < 1.5 * SIGMA_MM
    assert solution.observability.weakest_direction.endswith("'s z")


def test_an_error_of_the_number_shifts_x_along_the_axis_by_as_much_and_by_nothing_else() -> None:
    right = measured_camera()[1].mount_T_camera
    wrong = solve_hand_eye(measured(cell_of(1, "eye-in-hand"), "camera", 7.0)).mount_T_camera
    assert right is not None and wrong is not None
    assert np.allclose(wrong[:3, 3] - right[:3, 3], [0.0, 0.0, 7.0], atol=1e-3)
    assert np.allclose(wrong[:3, :3], right[:3, :3], atol=1e-7)


@pytest.mark.slow  # twenty solutions
def test_the_stated_uncertainty_is_right() -> None:
    rng = np.random.default_rng(3)
    errors = []
    for seed in seeds(20):
        for setup in ("eye-in-hand", "eye-to-hand"):
            cell = palletiser_cell(seed, setup)
            errors.append(
                normalised_error(cell, solve_hand_eye(measured(cell, "target", SIGMA_MM * rng.standard_normal())))
            )
    print(f"normalised error, mean square of {len(errors)} sessions: {np.mean(errors):.2f}")
    assert 0.7 < np.mean(errors) < 1.25  # 240 values by night: 1 +- 0.09


def test_a_mistyped_pose_is_left_out() -> None:
    problem = measured(cell_of(1, "eye-in-hand"), "camera")
    pose = problem.views[3].base_T_flange.copy()
    pose[0, 3] += 30.0
    views = (*problem.views[:3], problem.views[3].standing(base_T_flange=pose), *problem.views[4:])
    solution = solve_hand_eye(replace(problem, views=views))
    assert [view.index for view in solution.views if view.status == "rejected"] == [3]
    assert normalised_error(cell_of(1, "eye-in-hand"), solution) < 2.5


def test_without_travel_the_number_is_not_enough() -> None:
    problem = measured(cell_of(1, "eye-in-hand"), "camera")
    centre: Array = np.array([900.0, 0.0, 500.0])
    views = []
    for view in problem.views:
        pose = view.base_T_flange.copy()
        pose[:3, 3] = centre + pose[:3, :3] @ np.array([40.0, 0.0, 0.0])
        views.append(view.standing(base_T_flange=pose))
    solution = solve_hand_eye(replace(problem, views=tuple(views)))
    assert solution.mount_T_camera is None
    assert solution.findings[0].code == "parallel-axes"


def test_where_the_motions_determine_x_the_number_is_not_used() -> None:
    cell = random_cell(np.random.default_rng(2), 6, CellNoise())
    without = solve_hand_eye(cell.problem)
    with_number = solve_hand_eye(replace(cell.problem, axis_offset=AxisOffset("camera", 500.0, 0.1)))
    assert without.mount_T_camera is not None and with_number.mount_T_camera is not None
    assert np.array_equal(without.mount_T_camera, with_number.mount_T_camera)
    assert {finding.code for finding in with_number.findings} - {finding.code for finding in without.findings} == {
        "axis-offset-unused"
    }


def test_the_document_keeps_the_number() -> None:
    problem, solution = measured_camera()
    document = calibration_document(solution, judge(problem, solution), calibration_id="c", created_at="", software="")
    again = CalibrationDocument.model_validate_json(document.model_dump_json())
    assert again.axis_offset is not None
    assert again.axis_offset == problem.axis_offset


def test_no_advice_is_to_tilt() -> None:
    problem, solution = measured_camera()
    assert PlanComparison.for_session(problem, solution, NOISE) is None
    verdict = judge(problem, solution, DEFAULT_VERDICT_LIMITS.with_tolerance(0.1))
    fixes = [finding.fix for finding in verdict.findings]
    assert any("more exactly" in fix for fix in fixes)
    prior = ScenePrior("eye-in-hand", problem.target, problem.camera, None, None, NOISE)
    limits = ViewpointLimits(0.7, np.pi, (400.0, 700.0))
    for views in (problem.views[:1], problem.views):
        advice = advise(
            prior,
            replace(problem, views=views),
            limits,
            StoppingRule(3),
            base_T_flange_now=problem.views[0].base_T_flange,
        )
        assert advice.turns == (("z", 30.0),)
        fixes.append(advice.instruction)
    assert advice.now_mm is not None
    assert not any(word in fix for fix in fixes for word in ("tilt", "different axes", "its x", "its y"))
