"""Slips of convention and bookkeeping drawn at random: the cause is named first, with the setting to change."""

import zlib

import numpy as np
import pytest

from calibration.problem import Problem, Setup
from calibration.solution import Finding
from calibration.solve import solve_hand_eye
from calibration.transforms import rotation_from_vector, transform
from calibration.verdict import judge
from tests.simulated.damage import damaged_session
from tests.simulated.fault_kinds import GROSS
from tests.simulated.faults import SETUPS, Noise, simulated_session, with_poses
from tests.simulated.mixups import MIXUPS
from tests.simulated.varied_sessions import varied

CAUSELESS = {"contradictory-input", "too-few-poses", "too-little-rotation", "starts-disagree", "pose-disagrees"}
CAUSELESS |= {"not-converged", "no-tilt"}
"""What the solver says of the data without naming a cause."""

RULES = {"poses-contradict-images", "point-uncertain", "robot-noise", "image-noise", "many-rejected", "hold-out-large"}
RULES |= {"inverted-fits-as-well"}
"""What the verdict adds, after the causes."""


def causes(problem: Problem) -> list[Finding]:
    verdict = judge(problem, solve_hand_eye(problem))
    assert not verdict.accepted
    ours = [finding for finding in verdict.findings if finding.severity != "info"]
    return [finding for finding in ours if finding.code not in CAUSELESS]


@pytest.mark.parametrize(("number", "kind"), list(enumerate(MIXUPS)))
def test_the_cause_is_named_first_and_nothing_is_accepted(number: int, kind: str) -> None:
    clean = simulated_session(np.random.default_rng([3, number]), 12, Noise(), SETUPS[number % 2])
    fault = MIXUPS[kind](clean, np.random.default_rng([2, number]))
    first, *_ = causes(fault.problem)
    assert {first.code} == fault.codes, first
    assert all(words in first.message for words in fault.says) and fault.fix in first.fix


@pytest.mark.parametrize("setup", SETUPS)
def test_poses_at_random_have_no_cause(setup: Setup) -> None:
    """An explanation that leaves more than any robot errs by is none."""
    clean = simulated_session(np.random.default_rng(3), 10, Noise(), setup)
    rng = np.random.default_rng(4)
    random = transform(rotation_from_vector(rng.uniform(-3, 3, (10, 3))), rng.uniform(-900, 900, (10, 3)))
    assert {finding.code for finding in causes(with_poses(clean, random))} <= {"target-scale", *RULES}


def test_poses_far_too_long_beside_exact_pixels_are_named() -> None:
    """Their log-likelihood is about -1e18, beside which no difference of 30 is left."""
    clean = varied(np.random.default_rng((6301, 5, 8))).problem
    fault = GROSS["poses-in-micrometres"](clean, np.random.default_rng(0))
    assert "poses-in-micrometres" in {finding.code for finding in causes(fault.problem)}


@pytest.mark.parametrize(
    ("kind", "number"),
    [("pictures mirrored", 1), ("board one column more", 1), ("pictures turned from view k on", 0)],
)
def test_a_lens_or_a_size_that_follows_from_the_cause_is_not_named_before_it(kind: str, number: int) -> None:
    clean = varied(np.random.default_rng((6302, 5, number))).problem
    fault = MIXUPS[kind](clean, np.random.default_rng([6302, 2, number, zlib.crc32(kind.encode())]))
    assert {causes(fault.problem)[0].code} == fault.codes


def test_corners_that_overflow_the_lens_are_refused() -> None:
    problem = damaged_session(np.random.default_rng(71400467)).problem
    assert not judge(problem, solve_hand_eye(problem)).accepted


def test_pictures_are_turned_although_a_change_of_the_camera_fits_better() -> None:
    """They turn about their middle, a pixel from the principal point, which an exact robot shows."""
    clean = simulated_session(np.random.default_rng(6), 12, Noise(0.02, 0.0, 0.0), "eye-in-hand")
    fault = MIXUPS["pictures turned from view k on"](clean, np.random.default_rng(7))
    first, *_ = causes(fault.problem)
    assert first.code == "pictures-turned" and fault.says[0] in first.message
