"""Print, lens or arm not as described: X is right within its U from three views on, and the cause has a name."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.knowledge import Knowledge, TargetKnowledge
from calibration.likelihood.mapped_points import scale_variance_mm2
from calibration.problem import Setup
from calibration.solution import Solution
from calibration.solve import estimate_hand_eye, solve_hand_eye
from calibration.transforms import map_points
from calibration.verdict import judge
from tests.simulated.described_wrongly import (
    CAMERA,
    FAULTS,
    HIGH,
    LOW,
    Poses,
    Wrong,
    WrongSession,
    u_ratio,
    wrong_session,
)
from tests.simulated.faults import SETUPS
from tests.simulated.sessions import CellNoise
from tests.support.cases import crossed, seeds


def error_over_u(session: WrongSession, solution: Solution) -> float:
    """Largest error of the points of the working volume over U at the worst of them."""
    assert solution.mount_T_camera is not None
    assert solution.uncertainty is not None
    points = np.array([point.camera_mm for point in solution.uncertainty.points])
    off = map_points(solution.mount_T_camera, points) - map_points(session.mount_T_camera, points)
    return float(np.linalg.norm(off, axis=1).max() / solution.uncertainty.worst_point.expanded_mm)


@pytest.mark.parametrize(("fault", "setup"), crossed(FAULTS, SETUPS))
def test_x_is_right_within_its_uncertainty_at_the_default_number_of_views(fault: str, setup: Setup) -> None:
    tried = ((3, LOW), (4, LOW), (4, HIGH), (5, HIGH))
    for seed in seeds(len(tried)):
        views, noise = tried[seed]
        session = wrong_session(np.random.default_rng(seed), views, FAULTS[fault], noise, setup, "planned")
        assert error_over_u(session, estimate_hand_eye(session.problem)) < 1.5, (fault, views)


@pytest.mark.parametrize(
    ("focal", "views", "poses"), [(0.5, 4, "planned"), (0.5, 6, "random"), (0.4, 8, "random"), (2.0, 12, "planned")]
)
def test_a_lens_half_or_twice_as_long_as_stated_is_found(focal: float, views: int, poses: Poses) -> None:
    for seed in range(900, 903):
        session = wrong_session(np.random.default_rng(seed), views, Wrong(focal=focal), LOW, "eye-in-hand", poses)
        assert error_over_u(session, estimate_hand_eye(session.problem)) < 1.5, seed


@pytest.mark.parametrize(
    ("fault", "code"),
    [
        ("size 0.98", "target-scale"),
        ("focal +0.7 %", "focal-length-off"),
        ("centre 60 px", "principal-point-off"),
        ("stretch 0.5 %", "target-not-as-drawn"),
        ("bow 1.0 mm", "target-not-as-drawn"),
        ("keystone 0.5 %", "target-not-as-drawn"),
        ("tangential, rectified", "distortion-off"),
        ("autofocus", "lens-refocuses"),
        ("glass 5 mm", "target-below-glass"),
    ],
)
def test_the_cause_is_named_with_its_effect(fault: str, code: str) -> None:
    session = wrong_session(np.random.default_rng(7), 5, FAULTS[fault], LOW, "eye-in-hand", "planned")
    found = {finding.code: finding for finding in estimate_hand_eye(session.problem).findings}
    assert found[code].effect_mm is not None
    assert found[code].effect_mm > 0


@pytest.mark.parametrize(
    ("fault", "views", "camera_given"),
    [
        ("keystone 0.5 %", 3, True),
        ("keystone 0.5 %", 5, True),
        ("stretch with bow", 8, True),
        ("stretch with bow", 8, False),
    ],
)
def test_a_print_with_other_lines_moves_x_by_a_fraction_of_its_uncertainty(
    fault: str, views: int, camera_given: bool
) -> None:
    """Against a perfect print in the same pictures: images mix its shape up with the lens, as robot poses do not."""
    moved = []
    for seed in range(4):
        found = []
        for wrong in (FAULTS[fault], FAULTS["none"]):
            problem = wrong_session(np.random.default_rng(seed), views, wrong, LOW, "eye-in-hand", "planned").problem
            found.append(estimate_hand_eye(problem if camera_given else replace(problem, camera=None)))
        x, exact = found
        assert x.mount_T_camera is not None and exact.mount_T_camera is not None and x.uncertainty is not None
        points = np.array([point.camera_mm for point in x.uncertainty.points])
        off = np.linalg.norm(map_points(x.mount_T_camera, points) - map_points(exact.mount_T_camera, points), axis=1)
        moved.append(off.max() / x.uncertainty.worst_point.expanded_mm)
    assert np.sqrt(np.mean(np.square(moved))) < 0.4


@pytest.mark.parametrize("views", [3, 4])
@pytest.mark.parametrize(
    "described",
    [
        pytest.param([0.1, -0.05, 0.0, 0.0], id="other signs"),
        pytest.param([0.0, 0.0, 0.0, 0.0], id="none"),
    ],
)
def test_distortion_of_another_lens_is_found_from_three_views_on(described: list[float], views: int) -> None:
    """The lens is that of RADIAL, but for 0.1 px."""
    session = wrong_session(np.random.default_rng(7), views, Wrong(tangential_px=0.1), LOW, "eye-in-hand", "planned")
    camera = replace(CAMERA, distortion=np.array(described))
    solution = estimate_hand_eye(replace(session.problem, camera=camera))
    assert error_over_u(session, solution) < 1.0
    assert solution.uncertainty is not None and solution.uncertainty.worst_point.expanded_mm < 2.0
    assert "distortion-off" in {finding.code for finding in solution.findings}


def test_tangential_distortion_and_a_principal_point_that_are_both_off_leave_u_small() -> None:
    """Where the description has radial distortion alone, calibrated so, both are off."""
    wrong = Wrong(centre_px=8.0, tangential_px=1.5)
    session = wrong_session(np.random.default_rng(7), 8, wrong, LOW, "eye-in-hand", "planned")
    solution = estimate_hand_eye(session.problem)
    assert error_over_u(session, solution) < 1.0
    assert solution.uncertainty is not None and solution.uncertainty.worst_point.expanded_mm < 1.0


def test_a_print_fitted_to_its_page_is_measured_by_the_robot_and_not_refused() -> None:
    session = wrong_session(np.random.default_rng(5), 5, FAULTS["size 0.98"], LOW, "eye-in-hand", "planned")
    solution = solve_hand_eye(session.problem)
    assert judge(session.problem, solution).accepted
    assert error_over_u(session, solution) < 1.0


def test_a_certificate_that_is_wrong_is_named_and_does_not_bend_x() -> None:
    session = wrong_session(np.random.default_rng(3), 6, FAULTS["size 0.98"], LOW, "eye-in-hand", "planned")
    certified = replace(session.problem, knowledge=Knowledge(TargetKnowledge("certified", 0.0)))
    solution = estimate_hand_eye(certified)
    assert "statement-contradicted" in {finding.code for finding in solution.findings}
    assert error_over_u(session, solution) < 1.5


def test_what_is_known_beforehand_narrows_the_uncertainty() -> None:
    session = wrong_session(np.random.default_rng(11), 3, FAULTS["none"], LOW, "eye-in-hand", "random")
    stated = Knowledge(TargetKnowledge("certified", 0.0), "this-session", "absolute-accuracy")
    delivered, known = (
        estimate_hand_eye(replace(session.problem, knowledge=knowledge)).uncertainty
        for knowledge in (Knowledge(), stated)
    )
    assert delivered is not None
    assert known is not None
    assert known.worst_point.expanded_mm < delivered.worst_point.expanded_mm


@pytest.mark.parametrize("target", [TargetKnowledge(), TargetKnowledge("certified", 0.0)])
def test_a_registered_point_is_uncertain_by_the_scale_between_scanner_and_arm(target: TargetKnowledge) -> None:
    """Of an arm whose millimetre is 0.1 % long a cloud in true ones is off in proportion to its distance."""
    session = wrong_session(np.random.default_rng(2), 8, Wrong(arm=1.001), LOW, "eye-in-hand", "planned")
    problem = replace(session.problem, knowledge=Knowledge(target))
    solution = estimate_hand_eye(problem)
    assert solution.uncertainty is not None and solution.uncertainty.arm_scale is not None
    assert solution.mount_T_camera is not None
    worst, scale = solution.uncertainty.worst_point, solution.uncertainty.arm_scale
    at = np.array(worst.camera_mm)
    in_arms_mm = map_points(session.mount_T_camera, 1.001 * at[None])
    off = float(np.linalg.norm(map_points(solution.mount_T_camera, at[None]) - in_arms_mm))
    expanded_mm = 2 * float(np.sqrt(worst.sigma_mm**2 + scale_variance_mm2(scale, at)))
    assert worst.expanded_mm < off < 1.2 * expanded_mm
    if target.source == "certified":
        assert scale.log == pytest.approx(np.log(1.001), abs=3 * np.sqrt(scale.variance))
        assert scale.log > 2e-4, "the target's size tells the arm's"


@pytest.mark.parametrize("noise", [LOW, HIGH])
def test_u_comes_out_as_expected_before_the_last_view(noise: CellNoise) -> None:
    assert 0.8 < np.median([u_ratio(seed, 4, noise) for seed in range(1000, 1009)]) < 1.2
