"""A camera that warms up during a session: found from its temperatures, or from two looks from one pose."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calibration.diagnosis.warming import warming_findings
from calibration.documents.calibration import calibration_document
from calibration.documents.view_table import view_table
from calibration.problem import Problem
from calibration.solution import Solution
from calibration.solve import solve_hand_eye
from calibration.verdict import judge
from tests.simulated.sessions import CellNoise, observed, random_cell
from tests.simulated.warming import COLD_C, warmed

VIEWS, SHIFT_PX = 12, 3.0


@cache
def cold_session() -> Problem:
    """Twelve views, the last one from the pose of the first."""
    rng = np.random.default_rng(1)
    cell = random_cell(rng, VIEWS - 1, CellNoise())
    stations = np.concatenate([cell.base_T_flange, cell.base_T_flange[:1]])
    known = cell.problem.setup, cell.problem.target
    return observed(rng, *known, stations, cell.mount_T_camera, cell.anchor_T_target, CellNoise()).problem


@cache
def solved(shift_px: float, reported: bool) -> tuple[Problem, Solution]:
    problem = warmed(cold_session(), shift_px, reported=reported)
    return problem, solve_hand_eye(problem)


def said(solution: Solution) -> list[str]:
    return [finding.message.id for finding in solution.findings if finding.code == "still-warming"]  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("shift_px", "reported", "found"),
    [
        (0.0, True, []),
        (0.0, False, []),
        (SHIFT_PX, True, ["still-warming"]),
        (SHIFT_PX, False, ["still-warming-looks"]),
    ],
)
def test_a_shift_of_the_picture_is_found_and_a_steady_camera_left_alone(
    shift_px: float, reported: bool, found: list[str]
) -> None:
    problem, solution = solved(shift_px, reported)
    assert said(solution) == found
    assert [view.camera_temperature_c for view in solution.views] == [v.camera_temperature_c for v in problem.views]
    for finding in solution.findings:
        if finding.code == "still-warming":
            assert finding.message.params["shift_px"] == pytest.approx(shift_px, rel=0.3)  # type: ignore[attr-defined]
            assert "30 minutes" in finding.fix


def test_a_shift_that_does_not_matter_beside_u_is_not_reported() -> None:
    problem, solution = solved(SHIFT_PX, True)
    assert solution.uncertainty is not None
    (finding,) = warming_findings(problem, solution)
    shift_mm = finding.message.params["shift_mm"]  # type: ignore[attr-defined]
    worst_mm = solution.uncertainty.worst_point.expanded_mm
    vague = replace(solution, uncertainty=solution.uncertainty.scaled(2.1 * shift_mm / worst_mm))
    assert warming_findings(problem, vague) == ()


def test_a_temperature_that_has_nothing_to_do_with_the_shift() -> None:
    """It falls and rises, while the picture shifts one way: only the two looks from one pose show the shift."""
    problem, solution = solved(SHIFT_PX, True)
    views = tuple(
        replace(view, camera_temperature_c=40.0 + 5.0 * (-1) ** number) for number, view in enumerate(problem.views)
    )
    (finding,) = warming_findings(replace(problem, views=views), solution)
    assert finding.message.id == "still-warming-looks"  # type: ignore[attr-defined]


def test_the_temperature_stands_beside_each_view_in_the_table() -> None:
    for reported in (True, False):
        problem, solution = solved(SHIFT_PX, reported)
        verdict = judge(problem, solution)
        document = calibration_document(solution, verdict, calibration_id="c", created_at="now", software="handeyed 0")
        assert ("camera C" in view_table(document)) is reported
        assert (f" {COLD_C:.1f}" in view_table(document)) is reported
