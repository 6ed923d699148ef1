"""Slips of convention and bookkeeping drawn at random: the cause is named first, with the setting to change."""

import zlib
from dataclasses import replace

import numpy as np
import pytest

from calibration.camera import CameraModel
from calibration.diagnosis.intrinsics_check import scale_intrinsics
from calibration.problem import Detection, Problem, Setup
from calibration.sentences.sentence import Sentence
from calibration.solution import Finding
from calibration.solve import solve_hand_eye
from calibration.targets import Charuco, CircleGrid
from calibration.transforms import rotation_from_vector, transform
from calibration.verdict import judge
from tests.simulated.damage import damaged_session
from tests.simulated.fault_kinds import GROSS
from tests.simulated.faults import SETUPS, Noise, simulated_session, with_poses
from tests.simulated.imperfect_sessions import Imperfection, imperfect_cell
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
    [
        ("pictures mirrored", 1),
        ("board one column more", 1),
        ("pictures turned from view k on", 0),
        ("intrinsics of another picture size", 8),
    ],
)
def test_a_lens_or_a_size_that_follows_from_the_cause_is_not_named_before_it(kind: str, number: int) -> None:
    clean = varied(np.random.default_rng((6302, 5, number))).problem
    fault = MIXUPS[kind](clean, np.random.default_rng([6302, 2, number, zlib.crc32(kind.encode())]))
    assert {causes(fault.problem)[0].code} == fault.codes


def test_a_small_board_through_a_far_lens_is_not_seen_in_turned_pictures() -> None:
    """From intrinsics twice as long as the lens, the poses of some of these 101 views diverge."""
    small = Imperfection(lens=True, light=True, small_board=True)
    clean = imperfect_cell((2, 5), small).cell.problem
    fault = MIXUPS["intrinsics of another camera"](
        clean, np.random.default_rng([2, 5, zlib.crc32(b"intrinsics of another camera")])
    )
    found = {finding.code for finding in causes(fault.problem)} - RULES
    assert found == {"intrinsics-do-not-fit"}


def test_corners_that_overflow_the_lens_are_refused() -> None:
    problem = damaged_session(np.random.default_rng(71400467)).problem
    assert not judge(problem, solve_hand_eye(problem)).accepted


def test_pictures_are_turned_although_a_change_of_the_camera_fits_better() -> None:
    """They turn about their middle, a pixel from the principal point, which an exact robot shows."""
    clean = simulated_session(np.random.default_rng(6), 12, Noise(0.02, 0.0, 0.0), "eye-in-hand")
    fault = MIXUPS["pictures turned from view k on"](clean, np.random.default_rng(7))
    first, *_ = causes(fault.problem)
    assert first.code == "pictures-turned" and fault.says[0] in first.message


@pytest.mark.parametrize(("seed", "number"), [(7401, 1), (7401, 8), (7401, 35), (7511, 41)])
def test_pictures_turn_about_their_middle(seed: int, number: int) -> None:
    """The principal point lies 1 % of the width from it. The second session has 60 views, of which 50 are looked at
    first; in the others after it some turned views, or all, do not fit the lens and are not used."""
    clean = varied(np.random.default_rng((seed, 5, number))).problem
    kind = "pictures turned from view k on"
    fault = MIXUPS[kind](clean, np.random.default_rng([seed, 2, number, zlib.crc32(kind.encode())]))
    first, *_ = causes(fault.problem)
    assert first.code == "pictures-turned" and fault.says[0] in first.message


@pytest.mark.parametrize("number", [13, 22])
def test_a_symmetric_board_in_turned_pictures_is_not_read_the_wrong_way_round(number: int) -> None:
    clean = varied(np.random.default_rng((81003, 5, number))).problem
    kind = "pictures turned from view k on"
    fault = MIXUPS[kind](clean, np.random.default_rng([81003, 2, number, zlib.crc32(kind.encode())]))
    codes = [finding.code for finding in solve_hand_eye(fault.problem).findings]
    assert "pictures-turned" in codes
    assert not {"board-turned", "poses-swapped"}.intersection(codes)


@pytest.mark.parametrize("factor", [0.25, 2 / 3, 2.0])
def test_the_factor_of_the_intrinsics_is_the_one_to_set(factor: float) -> None:
    clean = simulated_session(np.random.default_rng(9), 8, Noise(), "eye-in-hand")
    assert clean.camera is not None
    other = scale_intrinsics(clean.camera, 1 / factor, clean.image_size)
    first, *_ = causes(replace(clean, camera=other))
    assert first.code == "intrinsics-do-not-fit"
    assert isinstance(first.fix, Sentence) and first.fix.params["factor"] == pytest.approx(factor)


def test_a_sensor_read_in_part_has_its_centre_elsewhere() -> None:
    """Its intrinsics look like those of larger pictures, and fit as they are."""
    clean = simulated_session(np.random.default_rng(9), 8, Noise(), "eye-in-hand")
    assert clean.camera is not None
    matrix, corner_px = clean.camera.matrix.copy(), -0.6 * clean.camera.matrix[:2, 2]
    matrix[:2, 2] += corner_px
    camera = CameraModel(matrix, clean.camera.distortion, clean.image_size)
    views = tuple(
        replace(view, detection=Detection(view.detection.ids, view.detection.corners_px + corner_px))
        for view in clean.views
        if view.detection is not None
    )
    part = replace(clean, camera=camera, views=views)
    verdict = judge(part, solve_hand_eye(part))
    assert verdict.accepted, verdict.findings


@pytest.mark.parametrize("kind", ["board one column less", "board transposed", "pictures mirrored"])
def test_a_grid_of_circles_is_mixed_up_as_well(kind: str) -> None:
    clean = simulated_session(np.random.default_rng(11), 12, Noise(), "eye-in-hand")
    board = clean.target
    assert isinstance(board, Charuco)
    circles = CircleGrid("symmetric", board.columns - 1, board.rows - 1, board.square_mm)
    fault = MIXUPS[kind](replace(clean, target=circles), np.random.default_rng(12))
    assert {causes(fault.problem)[0].code} == fault.codes
