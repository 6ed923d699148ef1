"""A camera and a scanner solved together: exact beside each other whatever the robot's errors, and honest."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.errors import GeometryError, UndeterminedError
from calibration.problem import MeasuredPose, Measurement, Setup
from calibration.solution import Solution
from calibration.solve import solve_hand_eye
from calibration.transforms import Array, difference, transform
from extensions.rigs.mathematics.report import rig_document, rig_lines
from extensions.rigs.mathematics.rig import RigSolution, solve_rig
from tests.simulated.measured_sessions import Measure, tracker
from tests.simulated.rigs import CAMERA_T_SCANNER, Rig, random_rig, squared_distance
from tests.simulated.sessions import CellNoise

POOR_ROBOT = CellNoise(0.05, float(np.radians(0.05)), 0.5)
CHI2_999 = 22.46
"""Exceeded by chi-square of six degrees of freedom with probability 0.001."""


@pytest.fixture(scope="module")
def rig() -> Rig:
    return random_rig(3, 8, POOR_ROBOT)


@pytest.fixture(scope="module")
def solved(rig: Rig) -> RigSolution:
    return solve_rig(rig.problems)


@pytest.fixture(scope="module")
def alone(rig: Rig) -> dict[str, Solution]:
    return {name: solve_hand_eye(problem) for name, problem in rig.problems.items()}


def test_the_robots_errors_do_not_enter_the_relative_pose(solved: RigSolution) -> None:
    camera_T_scanner, covariance = solved.relative(0, 1)
    off_mm, off_rad = difference(CAMERA_T_SCANNER, camera_T_scanner)
    assert off_mm < 0.2
    assert off_rad < 5e-4
    assert np.sqrt(np.diagonal(covariance)[3:]).max() < 0.1
    assert np.sqrt(np.diagonal(solved.covariance_of(1))[3:]).max() > 0.1
    assert (solved.stations, solved.shared) == (8, 8)


def test_both_are_at_least_as_exact_together_as_alone(solved: RigSolution, alone: dict[str, Solution]) -> None:
    for number, one in enumerate(alone.values()):
        assert one.uncertainty is not None
        assert np.trace(solved.covariance_of(number)[3:, 3:]) < 1.1 * np.trace(one.uncertainty.covariance[3:, 3:])


@pytest.mark.parametrize(("setup", "camera_given"), [("eye-in-hand", True), ("eye-to-hand", False)])
def test_the_errors_are_as_large_as_claimed(setup: Setup, camera_given: bool) -> None:
    rig = random_rig(11, 10, CellNoise(), setup=setup, camera_given=camera_given)
    solved = solve_rig(rig.problems)
    assert squared_distance(CAMERA_T_SCANNER, *solved.relative(0, 1)) < CHI2_999
    for number, true in enumerate((rig.mount_T_camera, rig.mount_T_camera @ CAMERA_T_SCANNER)):
        assert squared_distance(true, solved.mount_T_sensor[number], solved.covariance_of(number)) < CHI2_999


def long_tracker(factor: float) -> Measure:
    """A tracker whose lengths are too long."""

    def measured(rng: np.random.Generator, sensor_T_target: Array) -> Measurement:
        found = tracker()(rng, sensor_T_target)
        assert isinstance(found, MeasuredPose)
        pose = found.camera_T_target.copy()
        pose[:3, 3] *= factor
        return replace(found, camera_T_target=pose)

    return measured


@pytest.mark.parametrize("factor", [1.005, 0.998])
def test_lengths_of_a_sensor_in_space_are_not_taken_as_exact(factor: float) -> None:
    """0.5 % of 600 mm are 3 mm, and were beside a U of 0.7 mm."""
    for seed in range(500, 503):
        rig = random_rig(seed, 8, CellNoise(), measure=long_tracker(factor))
        solved = solve_rig(rig.problems)
        true = rig.mount_T_camera @ CAMERA_T_SCANNER
        assert squared_distance(true, solved.mount_T_sensor[1], solved.covariance_of(1)) < CHI2_999


def test_a_sensor_in_another_unit_is_refused() -> None:
    with pytest.raises(UndeterminedError, match="in metres"):
        solve_rig(random_rig(500, 8, CellNoise(), measure=long_tracker(1e-3)).problems)


def test_one_view_of_the_scanner_gives_its_pose_beside_a_calibrated_camera(rig: Rig) -> None:
    solved = solve_rig({**rig.problems, "scanner": replace(rig.scanner, views=rig.scanner.views[:1])})
    assert difference(CAMERA_T_SCANNER, solved.relative(0, 1)[0])[0] < 1.0
    assert solved.shared == 1


def test_a_target_that_moved_between_the_sessions_is_found(rig: Rig, alone: dict[str, Solution]) -> None:
    shift = transform(np.eye(3), [0.0, 40.0, 0.0])
    moved = tuple(view.standing(base_T_flange=shift @ view.base_T_flange) for view in rig.scanner.views)
    solved = solve_rig({**rig.problems, "scanner": replace(rig.scanner, views=moved)})
    document = rig_document(solved, alone, tolerance_mm=50.0)
    assert not document.verdict.accepted
    assert {"sensor-disagrees", "no-shared-station"} <= {finding.code for finding in document.verdict.findings}


@pytest.mark.parametrize(("tolerance_mm", "codes"), [(4.0, set()), (0.001, {"point-uncertain"})])
def test_the_tolerance_decides(
    solved: RigSolution, alone: dict[str, Solution], tolerance_mm: float, codes: set[str]
) -> None:
    document = rig_document(solved, alone, tolerance_mm)
    assert {finding.code for finding in document.verdict.findings} == codes
    assert document.verdict.accepted == (not codes)
    assert ("not accepted" in "\n".join(rig_lines(document))) == bool(codes)


def test_sensors_that_cannot_be_solved_together_are_refused(rig: Rig) -> None:
    with pytest.raises(GeometryError, match="1 sensors"):
        solve_rig({"camera": rig.camera})
    with pytest.raises(GeometryError, match="different set-ups"):
        solve_rig({"camera": rig.camera, "scanner": replace(rig.scanner, setup="eye-to-hand")})
    with pytest.raises(GeometryError, match="scanner has not seen"):
        solve_rig({"camera": rig.camera, "scanner": replace(rig.scanner, views=())})
    few = replace(rig.scanner, views=rig.scanner.views[:2])
    with pytest.raises(UndeterminedError, match="at least three"):
        solve_rig({"one": few, "other": few})
