"""Damaged sessions: a refusal or an answer, no error of numpy's own, and nothing is accepted beyond its uncertainty."""

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from calibration.likelihood.predicted_uncertainty import working_points_mm
from calibration.solution import Solution
from calibration.solve import solve_hand_eye
from calibration.transforms import map_points
from calibration.verdict import judge
from tests.simulated.damage import DISTANCE_MM, DamagedSession, damaged_session
from tests.support.cases import cases

COVERAGE_FACTOR = 3.0


@pytest.mark.slow
@settings(max_examples=cases(30), phases=(Phase.explicit, Phase.generate), deadline=None, derandomize=True)
@given(st.integers(0, 2**32 - 1))
def test_damage_ends_in_a_refusal_or_in_an_answer_within_its_uncertainty(seed: int) -> None:
    """`HANDEYED_CASES=20000 pytest tests/calibration/test_damaged_sessions.py` is the long run."""
    session = damaged_session(np.random.default_rng(seed))
    solution = solve_hand_eye(session.problem)
    verdict = judge(session.problem, solution)
    assert verdict.accepted or [finding for finding in verdict.findings if finding.severity == "error"]
    if verdict.accepted:
        assert excess(session, solution) < COVERAGE_FACTOR, (session.damages, verdict.findings)


def excess(session: DamagedSession, solution: Solution) -> float:
    """The RMS error of mapped points by X over their standard deviation; of the truth that is nearest."""
    assert solution.mount_T_camera is not None and solution.uncertainty is not None and solution.camera is not None
    points_mm = working_points_mm(solution.camera, DISTANCE_MM)
    seen_mm = map_points(solution.mount_T_camera, points_mm)
    errors_mm = [
        float(np.sqrt(np.mean(np.sum((seen_mm - map_points(truth, points_mm)) ** 2, axis=1))))
        for truth in session.truths
    ]
    return min(errors_mm) / solution.uncertainty.point_mm
