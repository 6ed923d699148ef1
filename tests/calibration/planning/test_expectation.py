"""What the views of a run were expected to leave, and why they left something else."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from calibration.likelihood.predicted_uncertainty import ExpectedNoise
from calibration.planning.expectation import NOTHING_EXPECTED, expectation_of
from calibration.solution import LeaveOutDocument, Noise, Solution
from tests.simulated.spoiled_sessions import solved_session

PROBLEM, SOLVED = solved_session()
BELIEF = ExpectedNoise(0.05, float(np.radians(0.01)), 0.1)
NOISE = Noise(BELIEF.image_px, BELIEF.robot_rotation_rad, BELIEF.robot_translation_mm)
LEFT_OUT = LeaveOutDocument(1.0, 9.0, 6.0, 1.0, "image", 4)


def expected_mm() -> float:
    found = expectation_of(PROBLEM, SOLVED, BELIEF, ()).expanded_mm
    assert found is not None
    return found


def found_to_be(times: float, **changes: Any) -> Solution:
    """The solution with a U that many times the expected one, and the noise as believed."""
    assert SOLVED.uncertainty is not None
    factor = times * expected_mm() / SOLVED.uncertainty.worst_point.expanded_mm
    as_believed = {"noise": NOISE, "leave_out": None, "uncertainty": SOLVED.uncertainty.scaled(factor)}
    return replace(SOLVED, **{**as_believed, **changes})


@pytest.mark.parametrize("times", [0.7, 1.0, 1.45])
def test_no_reason_is_needed_for_what_was_about_expected(times: float) -> None:
    assert expectation_of(PROBLEM, found_to_be(times), BELIEF, ()).why is None


@pytest.mark.parametrize(
    ("times", "changes", "reason"),
    [
        (2.0, {"noise": Noise(0.05, NOISE.robot_rotation_rad, 0.3)}, "accuracy-robot-mm"),
        (2.0, {"noise": Noise(0.05, 5 * BELIEF.robot_rotation_rad, 0.3)}, "accuracy-robot-deg"),
        (2.0, {"noise": Noise(0.2, NOISE.robot_rotation_rad, 0.1)}, "accuracy-image-px"),
        (2.0, {"leave_out": LEFT_OUT}, "accuracy-left-out"),
        (2.0, {}, "accuracy-not-noise"),
        (0.5, {"noise": Noise(0.05, NOISE.robot_rotation_rad, 0.02)}, "accuracy-robot-mm"),
        (0.5, {}, "accuracy-less-counted"),
    ],
)
def test_a_u_that_was_not_expected_has_a_reason(times: float, changes: dict[str, Any], reason: str) -> None:
    why = expectation_of(PROBLEM, found_to_be(times, **changes), BELIEF, ()).why
    assert why is not None and why.params["reason"].id == reason
    assert why.params["expected_mm"] == expected_mm()


def test_nothing_is_expected_where_x_is_not_determined() -> None:
    assert expectation_of(PROBLEM, replace(SOLVED, mount_T_camera=None), BELIEF, ()) == NOTHING_EXPECTED
