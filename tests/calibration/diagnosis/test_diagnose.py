"""The diagnosis itself: what must not change it, how it grows, what it leaves to others."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calibration.diagnosis.convention_hypotheses import likeliest_scale, target_scale
from calibration.diagnosis.diagnose import Diagnosis, diagnose
from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.findings import severity_of
from calibration.diagnosis.fit import fit, fits
from calibration.diagnosis.mount_check import ExpectedMount, mount_findings
from calibration.diagnosis.screening import needs_diagnosis
from calibration.diagnosis.view_hypotheses import change_p_value
from calibration.kinematics.stance import Stance
from calibration.problem import Setup
from calibration.solve import solve_hand_eye
from calibration.transforms import Array, inverse, rotation_from_vector, transform
from tests.simulated.faults import (
    BOARD,
    Noise,
    clean_fit,
    in_convention,
    mistyped,
    poses_of,
    simulated_session,
    swapped,
)

ORDINARY = Noise(0.05, 0.1, 0.01)
CENTRE_MM = BOARD.points_mm.mean(axis=0)


def evidence(seed: int, n: int = 12, noise: Noise | None = None) -> Evidence:
    setup = ("eye-in-hand", "eye-to-hand")[seed % 2]
    problem = simulated_session(np.random.default_rng(seed), n, noise or Noise(), setup)  # type: ignore[arg-type]
    return clean_fit(problem)[0]


def mistyped_at(clean: Evidence, row: int, size_mm: float) -> Evidence:
    poses = clean.base_T_flange.copy()
    poses[row, 0, 3] += size_mm
    return clean.with_robot_poses(poses)


def named(spoilt: Evidence) -> Diagnosis:
    diagnosis = diagnose(spoilt, CENTRE_MM, len(spoilt))
    assert diagnosis is not None
    return diagnosis


def about_z(n: int) -> Array:
    return rotation_from_vector(np.linspace(0, 2, n)[:, None] * [0.0, 0.0, 1.0])


angles = st.lists(st.floats(-3, 3), min_size=3, max_size=3)
lengths = st.lists(st.floats(-3000, 3000), min_size=3, max_size=3)


@pytest.mark.slow
@settings(max_examples=6, deadline=None)
@given(angles, lengths)
def test_where_the_base_frame_stands_changes_nothing(turn: list[float], shift: list[float]) -> None:
    spoilt = mistyped_at(evidence(2), 5, 8.0)
    other_base = transform(rotation_from_vector(np.array(turn)), shift)
    moved = spoilt.with_robot_poses(other_base @ spoilt.base_T_flange)
    before, after = named(spoilt), named(moved)
    assert (before.cause.code, before.cause.where) == (after.cause.code, after.cause.where) == ("pose-mistyped", (5,))
    assert fit(moved).log_likelihood == pytest.approx(fit(spoilt).log_likelihood, abs=0.1)


@pytest.mark.slow
@settings(max_examples=5, deadline=None)
@given(st.permutations(range(12)))
def test_the_order_of_the_views_does_not_matter_to_a_mistyped_pose(order: list[int]) -> None:
    spoilt = mistyped_at(evidence(4), 5, 8.0)
    assert named(spoilt.take(np.array(order))).cause.where == (5,)


def test_fitting_together_is_fitting_one_by_one() -> None:
    sessions = [mistyped_at(evidence(6), row, 3.0) for row in range(4)]
    labels = (np.arange(12) >= 5).astype(np.intp)
    for x_labels, y_labels in ((None, None), (labels, None), (None, labels)):
        together = fits(sessions, [x_labels] * 4, [y_labels] * 4)
        for one, session in zip(together, sessions, strict=True):
            alone = fit(session, x_labels, y_labels)
            assert one.log_likelihood == pytest.approx(alone.log_likelihood, abs=0.3)


def test_the_noise_of_the_robot_is_found() -> None:
    found = [fit(evidence(seed, 30, Noise(0.05, 0.2, 0.02))).robot_noise for seed in range(10, 18)]
    assert np.mean([one.translation_mm for one in found]) == pytest.approx(0.2, rel=0.1)
    assert np.degrees(np.mean([one.rotation_rad for one in found])) == pytest.approx(0.02, rel=0.1)


def test_the_size_of_the_target_is_measured_by_the_robot() -> None:
    assert target_scale(evidence(8, 15).scale_target(1 / 1.25)) == pytest.approx(1.25, rel=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("n", [60, 250])
def test_many_views_are_thinned_and_the_one_at_fault_is_found_all_the_same(n: int) -> None:
    clean = evidence(12, n)
    assert named(mistyped_at(clean, n - 7, 8.0)).cause.where == (n - 7,)
    poses = clean.base_T_flange.copy()
    after = n // 2 + 3
    poses[after:] = poses[after:] @ transform(np.eye(3), [0.0, 3.0, 3.0])
    assert named(clean.with_robot_poses(poses)).cause.where == (after,)


@pytest.mark.parametrize("size_mm", [0.6, 0.8, 1.0])
def test_the_gate_opens_for_what_the_diagnosis_names_in_many_views(size_mm: float) -> None:
    spoilt = mistyped_at(evidence(20, 40, ORDINARY), 9, size_mm)
    assert diagnose(spoilt, CENTRE_MM, len(spoilt)) is None or needs_diagnosis(spoilt, fit(spoilt))


def test_the_gate_stays_shut_for_most_clean_sessions_of_many_views() -> None:
    sessions = [evidence(seed, 40, ORDINARY) for seed in range(40, 50)]
    assert sum(needs_diagnosis(session, fit(session)) for session in sessions) <= 3


def test_fewer_than_five_views_blame_nobody() -> None:
    assert diagnose(mistyped_at(evidence(3, 4), 1, 100.0), CENTRE_MM, 4) is None


def test_the_runner_up_is_far_behind_when_the_cause_is_plain() -> None:
    problem = simulated_session(np.random.default_rng(5), 10, Noise(), "eye-in-hand")
    fault = swapped(problem, np.random.default_rng(1))
    seen = clean_fit(problem)[0]
    diagnosis = named(seen.with_robot_poses(poses_of(fault.problem)))
    assert diagnosis.cause.code == "poses-swapped"
    assert diagnosis.gain > diagnosis.runner_up_gain + 50
    assert severity_of(diagnosis, set(range(10))) == "warning"


def test_a_repaired_corner_order_is_reported_once() -> None:
    problem = simulated_session(np.random.default_rng(7), 10, Noise(), "eye-to-hand")
    views = list(problem.views)
    seen = views[4].detection
    assert seen is not None
    turned = type(seen)(len(BOARD.points_mm) - 1 - seen.ids, seen.corners_px)
    views[4] = type(views[4])(4, views[4].stance, turned)
    solution = solve_hand_eye(
        type(problem)(problem.setup, problem.target, problem.camera, problem.image_size, tuple(views))
    )
    assert solution.views[4].status == "corrected"
    assert [f.code for f in solution.findings if f.severity != "info"] == ["board-turned"]


def test_orientations_too_small_by_a_unit_are_refused_and_the_unit_is_named() -> None:
    problem = simulated_session(np.random.default_rng(8), 10, Noise(), "eye-in-hand")
    fault = in_convention("radians-read-as-degrees")(problem, np.random.default_rng(0))
    solution = solve_hand_eye(fault.problem)
    assert solution.mount_T_camera is None
    assert {"too-little-rotation", "radians-read-as-degrees"} <= {f.code for f in solution.findings}


@pytest.mark.parametrize(
    "poses, code",
    [
        (lambda P: np.repeat(P[:1], len(P), axis=0), "too-few-poses"),
        (lambda P: transform(P[:1, :3, :3], P[:, :3, 3]), "pure-translation"),
        (lambda P: transform(about_z(len(P)), P[:, :3, 3]), "parallel-axes"),
    ],
)
def test_motions_that_determine_nothing_have_codes_of_their_own(poses, code: str) -> None:  # type: ignore[no-untyped-def]
    problem = simulated_session(np.random.default_rng(9), 8, Noise(), "eye-in-hand")
    views = tuple(
        type(view)(view.index, Stance(pose), view.detection)
        for view, pose in zip(problem.views, poses(poses_of(problem)), strict=True)
    )
    solution = solve_hand_eye(type(problem)(problem.setup, BOARD, problem.camera, problem.image_size, views))
    assert solution.mount_T_camera is None
    assert solution.findings[0].code == code


@pytest.mark.parametrize("setup", ["eye-in-hand", "eye-to-hand"])
def test_motions_that_determine_nothing_say_nothing_of_conventions(setup: Setup) -> None:
    """However they are turned: where the closed form starts there, and where the fit ends, is rounding's choice."""
    rng = np.random.default_rng(3)
    for _ in range(6):
        poses = transform(rotation_from_vector(rng.uniform(-2, 2, 3)), rng.uniform(-100, 100, (8, 3)))
        seen = inverse(poses if setup == "eye-in-hand" else inverse(poses))
        exact = np.tile(1e-12 * np.eye(6), (8, 1, 1))
        turned = transform(rotation_from_vector(rng.uniform(-2, 2, 3)), rng.uniform(-50, 50, 3))
        still = Evidence(setup, np.arange(8), poses, turned @ seen @ turned, exact, np.full(8, 100.0))
        assert diagnose(still, CENTRE_MM, len(still)) is None


def test_a_camera_that_is_not_where_the_drawing_has_it_is_reported() -> None:
    expected = transform(np.eye(3), [0.0, 0.0, 60.0])
    tool = transform(rotation_from_vector(np.array([0.0, 0.0, np.pi / 4])), [0.0, 0.0, 120.0])
    (finding,) = mount_findings(inverse(tool) @ expected, ExpectedMount(expected))
    assert finding.code == "mount-not-as-expected"
    assert "120.0 mm and 45.0 degrees" in finding.message
    assert mount_findings(expected @ transform(np.eye(3), [5.0, 0, 0]), ExpectedMount(expected)) == ()
    assert mount_findings(inverse(tool) @ expected, ExpectedMount(expected, 130.0, 1.0)) == ()


def test_a_slip_within_the_noise_is_not_blamed_on_anyone() -> None:
    problem = simulated_session(np.random.default_rng(11), 12, Noise(), "eye-in-hand")
    slip = mistyped(problem, np.random.default_rng(0))
    assert [f.code for f in solve_hand_eye(slip.at(0.05).problem).findings if f.severity != "info"] == []


def test_the_size_of_the_target_is_the_likeliest_where_images_measure_distances_badly() -> None:
    """Least squares, without weights, errs there by more than what is to be found."""
    off = []
    for seed in range(4):
        seen = evidence(seed, 15, Noise(0.5, 0, 0)).scale_target(1 / 1.002)
        off.append((likeliest_scale(seen) - 1.002, target_scale(seen) - 1.002))
    likeliest, least_squares = np.sqrt(np.mean(np.square(off), axis=0))
    assert likeliest < 2e-4 < least_squares


def test_a_target_that_is_only_warm_is_nobody_s_fault() -> None:
    exact = evidence(5, 20, Noise(0.002, 0, 0))
    assert diagnose(exact.scale_target(1 / 1.00015), CENTRE_MM, len(exact)) is None
    assert named(exact.scale_target(1 / 1.0008)).cause.code == "wrong-pitch"


def test_two_views_between_which_a_change_cannot_be_located_are_both_named() -> None:
    clean = evidence(30, 12, ORDINARY)
    poses = clean.base_T_flange.copy()
    poses[6:] = transform(np.eye(3), [0.0, 4.0, 0.0]) @ poses[6:]
    vague = clean.covariance.copy()
    vague[6] *= 1e6  # the picture at which it happened tells nothing
    moved = replace(clean.with_robot_poses(poses), covariance=vague)
    message = named(moved).cause.message
    assert "moved before picture 7 (or 8):" in message or "moved before picture 8 (or 7):" in message


@pytest.mark.slow
def test_chances_in_clean_sessions_are_evenly_spread() -> None:
    """Among few views too, whose noise is known from themselves only."""
    after = np.arange(6) >= 3
    changed = [fit(evidence(seed, 6, ORDINARY), None, after.astype(np.intp)) for seed in range(100, 160)]
    chances = np.array([change_p_value(evidence(0, 6), fitted, of_x=False) for fitted in changed])
    assert 0.3 < np.mean(chances < 0.5) < 0.7
    assert np.mean(chances < 0.05) < 0.12


@pytest.mark.parametrize("setup", ["eye-in-hand", "eye-to-hand"])
def test_views_of_one_point_from_one_distance_do_not_make_translations_too_large(setup: Setup) -> None:
    """Translations of any size fit such views with another X, small ones even better: the robot's errors shrink too."""
    for seed in range(4):
        middle_mm = np.array([0.0, 0.0, 520.0])
        problem = simulated_session(np.random.default_rng(seed), 9, Noise(0.03, 0.15, 0.02), setup, middle_mm)
        found = diagnose(clean_fit(problem)[0], CENTRE_MM, 9)
        assert found is None or found.cause.code not in ("poses-in-micrometres", "poses-in-metres", "poses-in-inches")
