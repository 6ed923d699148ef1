"""A contradiction weighs what it does to a measured point."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.camera import CameraModel
from calibration.likelihood.predicted_uncertainty import point_weights, working_points_mm
from calibration.problem import Problem, Setup
from calibration.solution import COVERAGE_FACTOR, Finding, Solution
from calibration.solve import solve_hand_eye
from calibration.transforms import inverse, vector_from_transform
from calibration.verdict import Verdict, VerdictLimits, judge
from tests.simulated.described_wrongly import FAULTS, LOW, wrong_session
from tests.simulated.fault_kinds import GROSS
from tests.simulated.faults import Noise, focal_wrong, moved, simulated_session
from tests.simulated.faulty_sessions import simulated
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
    assert all("measured point moves by" in finding.message for finding in found)
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


def shift_mm(one: Solution, other: Solution) -> float:
    """RMS over the working volume at 650 mm, between points mapped by two X."""
    assert one.mount_T_camera is not None and other.mount_T_camera is not None and one.camera is not None
    off = vector_from_transform(inverse(one.mount_T_camera) @ other.mount_T_camera)
    return float(np.sqrt(off @ point_weights(working_points_mm(one.camera, 650.0)) @ off))


def lens_of(solution: Solution) -> Finding:
    (found,) = (finding for finding in solution.findings if finding.code == "intrinsics-do-not-fit")
    return found


@pytest.mark.parametrize("longer", [1.003, 1.005])
def test_an_error_of_the_lens_that_the_estimate_does_not_know_is_refused_and_within_u(longer: float) -> None:
    """Of unequal focal lengths a principal point elsewhere takes up a part, and turns X by it: 5.5 and 8.8 mm."""
    clean = simulated_session(np.random.default_rng(0), 12, Noise(), "eye-in-hand")
    assert clean.camera is not None
    matrix = clean.camera.matrix * np.array([[1.0], [longer], [1.0]])
    matrix[1, 2] = clean.camera.matrix[1, 2]
    problem = replace(clean, camera=replace(clean.camera, matrix=matrix))
    solution = solve_hand_eye(problem)
    found, uncertainty = lens_of(solution), solution.uncertainty
    assert uncertainty is not None and found.effect_mm is not None
    wrong_mm = shift_mm(solution, solve_hand_eye(clean))
    assert wrong_mm == pytest.approx(found.effect_mm, abs=0.5)
    assert 2 < wrong_mm < 1.1 * COVERAGE_FACTOR * uncertainty.point_mm
    assert f"a measured point moves by {found.effect_mm:.2g} mm" in found.message
    verdict = judge(problem, solution)
    first, *_ = (finding for finding in verdict.findings if finding.severity == "error")
    assert first.code == "intrinsics-do-not-fit"


@pytest.mark.parametrize("p1_and_p2", [(2e-3, 0.0), (0.0, 5e-3)])
def test_tangential_distortion_that_the_lens_does_not_have_is_found(p1_and_p2: tuple[float, float]) -> None:
    """As a principal point elsewhere it would turn X by 3 and 8 mm."""
    clean = simulated_session(np.random.default_rng(0), 12, Noise(), "eye-in-hand")
    assert clean.camera is not None
    distortion = np.array([0.0, 0.0, *p1_and_p2, 0.0])
    problem = replace(clean, camera=CameraModel(clean.camera.matrix, distortion, clean.camera.image_size))
    solution = solve_hand_eye(problem)
    assert judge(problem, solution).accepted
    assert "distortion-off" in {finding.code for finding in solution.findings}
    assert shift_mm(solution, solve_hand_eye(clean)) < 0.4


@pytest.mark.parametrize("p1_and_p2", [(5e-4, 0.0), (0.0, -2e-3)])
def test_tangential_distortion_that_the_description_leaves_out_is_found(p1_and_p2: tuple[float, float]) -> None:
    """1.4 and 6 px at the corner."""
    seen = simulated_session(np.random.default_rng(0), 12, Noise(), "eye-in-hand")
    assert seen.camera is not None
    lens = replace(seen.camera, distortion=np.array([-0.1, 0.05, *p1_and_p2, 0.0]))
    views = []
    for view in seen.views:
        assert view.detection is not None
        rays = seen.camera.normalise(view.detection.corners_px)
        corners_px = lens.project(np.column_stack([rays, np.ones(len(rays))]))
        views.append(replace(view, detection=replace(view.detection, corners_px=corners_px)))
    without = replace(seen.camera, distortion=np.array([-0.1, 0.05, 0.0, 0.0, 0.0]))
    solution = solve_hand_eye(replace(seen, camera=without, views=tuple(views)))
    assert "distortion-off" in {finding.code for finding in solution.findings}
    assert shift_mm(solution, solve_hand_eye(seen)) < 0.3


def test_another_focus_that_the_estimate_has_found_is_said_and_widens_nothing() -> None:
    clean = simulated_session(np.random.default_rng(0), 12, Noise(), "eye-in-hand")
    problem = focal_wrong(clean, np.random.default_rng(0)).at(0.02).problem
    right, solution = solve_hand_eye(clean), solve_hand_eye(problem)
    verdict = judge(problem, solution)
    said = {finding.code: finding.severity for finding in verdict.findings}
    assert verdict.accepted
    assert (said["focal-length-off"], said["intrinsics-do-not-fit"]) == ("warning", "warning")
    assert lens_of(solution).effect_mm is None
    assert right.uncertainty is not None and solution.uncertainty is not None
    assert solution.uncertainty.point_mm < 1.2 * right.uncertainty.point_mm
    assert shift_mm(right, solution) < 0.2


def test_another_focus_is_not_named_as_another_pitch() -> None:
    """As described, the lens makes the target 0.6 % smaller; the estimate knows better."""
    clean = simulated(np.random.default_rng((5, 0, 3))).problem
    problem = focal_wrong(clean, np.random.default_rng(1)).at(0.011).problem
    right, solution = solve_hand_eye(clean), solve_hand_eye(problem)
    codes = {finding.code for finding in solution.findings}
    assert "focal-length-off" in codes and not codes & {"wrong-pitch", "target-scale"}
    assert right.uncertainty is not None and solution.uncertainty is not None
    assert solution.uncertainty.point_mm < 1.2 * right.uncertainty.point_mm


@pytest.mark.parametrize("seed", [0, 2])
def test_a_stretched_print_is_neither_another_lens_nor_a_mistyped_pose(seed: int) -> None:
    """With the target as described the poses of the views are wrong, each in its own way."""
    rng = np.random.default_rng([7, 8, seed])
    session = wrong_session(rng, 8, FAULTS["stretch 0.5 %"], LOW, "eye-in-hand", "planned")
    codes = {finding.code for finding in solve_hand_eye(session.problem).findings}
    assert codes <= {"target-not-as-drawn", "noise-assumed"}
