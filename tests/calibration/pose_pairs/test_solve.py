"""X from pairs of poses: found within its own uncertainty, robust, and refused where the motions do not tell."""

from collections.abc import Callable

import numpy as np
import pytest

from calibration.errors import UndeterminedError
from calibration.likelihood.mapped_points import point_rows
from calibration.problem import Setup
from calibration.transforms import (
    Array,
    inverse,
    rotation_from_vector,
    transform,
    vector_from_rotation,
    vector_from_transform,
)
from tests.simulated.pose_pairs import PoseNoise, drawn_session, with_alike_errors
from tests.support.cases import seeds
from tests.support.pose_arrays import solve_hand_eye_poses

X = transform(rotation_from_vector([0.3, -2.0, 0.4]), [40.0, -60.0, 90.0])
Y = transform(rotation_from_vector([-0.2, 0.1, 1.4]), [700.0, 100.0, -50.0])


def poses(
    rng: np.random.Generator, turns: Array, setup: Setup, deg: float = 0.02, mm: float = 0.1
) -> tuple[Array, ...]:
    """Robot and camera poses (n, 4, 4) for turns (n, 3); the reported robot poses err."""
    stands = transform(rotation_from_vector(turns), 80 * rng.standard_normal(turns.shape))
    error = transform(
        rotation_from_vector(np.radians(deg) * rng.standard_normal(turns.shape)), mm * rng.standard_normal(turns.shape)
    )
    anchor_T_mount = stands if setup == "eye-in-hand" else inverse(stands)
    return stands @ error, inverse(anchor_T_mount @ X) @ Y


@pytest.mark.slow
@pytest.mark.parametrize("setup", ["eye-in-hand", "eye-to-hand"])
def test_errors_have_the_size_that_the_covariance_predicts(setup: Setup) -> None:
    normalised = []
    for seed in seeds(20):
        rng = np.random.default_rng(seed)
        found = solve_hand_eye_poses(setup, *poses(rng, 0.4 * rng.standard_normal((15, 3)), setup))
        off = inverse(X) @ found.mount_T_camera
        error = np.concatenate([vector_from_rotation(off[:3, :3]), off[:3, 3]])
        normalised.append(error / np.sqrt(np.diagonal(found.covariance)[:6]))
    assert 0.7 < np.std(normalised) < 1.4


@pytest.mark.slow
def test_five_views_do_not_claim_more_than_they_know() -> None:
    """Levels learnt from so few numbers are mostly too small: taken at their likeliest, the mean here is six."""
    squares = []
    for seed in seeds(24):
        session = drawn_session(np.random.default_rng(seed), 5, PoseNoise(0.02, 0.1, 0.02, 0.1), "random")
        found = solve_hand_eye_poses("eye-in-hand", session.anchor_T_mount, session.camera_T_target)
        off = inverse(session.mount_T_camera) @ found.mount_T_camera
        error = np.concatenate([vector_from_rotation(off[:3, :3]), off[:3, 3]])
        squares.append(error @ np.linalg.solve(found.covariance[:6, :6], error) / 6)
    assert 0.6 < np.mean(squares) < 1.7


@pytest.mark.slow
def test_halves_of_a_set_agree_within_u_though_like_views_share_errors() -> None:
    """As detectors' errors are; independent ones, as they are taken for at first, leave 40 % beyond U."""
    beyond = []
    for seed in seeds(36, every=6):
        rng = np.random.default_rng(seed)
        session = drawn_session(rng, 60, PoseNoise(0.005, 0.05, 0.02, 0.1), "looking")
        seen = with_alike_errors(rng, session.camera_T_target, deg=0.15, mm=0.5)
        left_to_right = np.argsort(seen[:, 0, 3])
        one, other = (
            solve_hand_eye_poses("eye-in-hand", session.anchor_T_mount[half], seen[half])
            for half in (left_to_right[:30], left_to_right[30:])
        )
        by_x = point_rows(np.array([[0.0, 0.0, 550.0]]))[0]
        off = by_x @ vector_from_transform(inverse(one.mount_T_camera) @ other.mount_T_camera)
        covariance = by_x @ (one.covariance + other.covariance)[:6, :6] @ by_x.T
        beyond.append(np.linalg.norm(off) > 2 * np.sqrt(np.trace(covariance)))
    assert np.mean(beyond) <= 0.05


def test_few_views_give_the_same_in_any_unit_of_the_camera() -> None:
    rng = np.random.default_rng(6)
    robot, seen = poses(rng, 0.4 * rng.standard_normal((9, 3)), "eye-in-hand")
    told = []
    for unit in (1.0, 1e-3):
        shrunk = seen.copy()
        shrunk[:, :3, 3] *= unit
        found = solve_hand_eye_poses("eye-in-hand", robot, shrunk, metric=False)
        told.append((found.mount_T_camera[:3, 3], np.sqrt(np.diagonal(found.covariance))[:6]))
    (place, sigma), (other_place, other_sigma) = told
    assert place == pytest.approx(other_place, abs=0.05)
    assert sigma == pytest.approx(other_sigma, rel=0.05)


@pytest.mark.parametrize("views", [5, 10])
def test_poses_without_error_are_no_trouble(views: int) -> None:
    rng = np.random.default_rng(2)
    robot, seen = poses(rng, 0.4 * rng.standard_normal((views, 3)), "eye-in-hand", deg=0.0, mm=0.0)
    found = solve_hand_eye_poses("eye-in-hand", robot, seen)
    assert found.mount_T_camera == pytest.approx(X, abs=1e-3)


def test_views_that_disagree_are_left_out() -> None:
    rng = np.random.default_rng(3)
    robot, seen = poses(rng, 0.4 * rng.standard_normal((20, 3)), "eye-in-hand")
    seen[[2, 9, 11]] = seen[[2, 9, 11]] @ transform(rotation_from_vector([0.0, 0.5, 0.0]), [0.0, 0.0, 40.0])
    found = solve_hand_eye_poses("eye-in-hand", robot, seen)
    assert np.flatnonzero(~found.used).tolist() == [2, 9, 11]
    assert np.linalg.norm((inverse(X) @ found.mount_T_camera)[:3, 3]) < 1.0


@pytest.mark.parametrize("seed", [11, 18, 37])
def test_five_honest_views_are_all_used(seed: int) -> None:
    """Sessions in which the best three agree so well with themselves that they would outvote the other two."""
    session = drawn_session(np.random.default_rng(seed), 5, PoseNoise(0.05, 0.3, 0.01, 0.05), "looking")
    found = solve_hand_eye_poses("eye-in-hand", session.anchor_T_mount, session.camera_T_target)
    assert np.all(found.used)
    assert np.linalg.norm((inverse(session.mount_T_camera) @ found.mount_T_camera)[:3, 3]) < 3.0


ONE_AXIS = np.array([0.6, 0.0, 0.8])


@pytest.mark.parametrize(
    ("turns", "code"),
    [
        (lambda rng: rng.uniform(-0.4, 0.4, (12, 1)) * ONE_AXIS, "parallel-axes"),
        (lambda rng: 0.02 * rng.standard_normal((12, 3)), "too-little-rotation"),
        (lambda rng: np.zeros((12, 3)), "pure-translation"),
    ],
)
@pytest.mark.parametrize("deg", [0.0, 0.05])
def test_motions_that_determine_too_little_are_refused_whatever_the_noise(
    turns: Callable[[np.random.Generator], Array], code: str, deg: float
) -> None:
    for seed in range(10):
        rng = np.random.default_rng(seed)
        with pytest.raises(UndeterminedError) as refused:
            solve_hand_eye_poses("eye-in-hand", *poses(rng, turns(rng), "eye-in-hand", deg))
        assert refused.value.code in (code, "too-little-rotation" if code == "pure-translation" else code)


def seen_with(rng: np.random.Generator, seen: Array, rad: float, across_mm: float, along_mm: float) -> Array:
    """The camera's poses with errors in rotation, across its optical axis and along it."""
    n = len(seen)
    noisy = seen.copy()
    noisy[:, :3, :3] = seen[:, :3, :3] @ rotation_from_vector(rad * rng.standard_normal((n, 3)))
    noisy[:, :3, 3] += rng.standard_normal((n, 3)) * [across_mm, across_mm, along_mm]
    return noisy


def far_target(rng: np.random.Generator, views: int) -> tuple[Array, Array]:
    """Robot and camera poses of a target half a metre in front of the camera, without any error."""
    turns = transform(rotation_from_vector(0.4 * rng.standard_normal((views, 3))), np.zeros((views, 3)))
    where = transform(np.eye(3), 40 * rng.standard_normal((views, 3)) + [0.0, 0.0, 500.0])
    seen = where @ turns
    return Y @ inverse(X @ seen), seen


@pytest.mark.slow
def test_a_camera_that_is_worse_in_depth_is_found_to_be() -> None:
    rng = np.random.default_rng(8)
    robot, seen = far_target(rng, 120)
    found = solve_hand_eye_poses("eye-in-hand", robot, seen_with(rng, seen, 1e-3, 0.2, 2.0))
    across = np.hypot(found.deviations["camera lateral"], found.deviations["robot translation"])
    assert found.deviations["camera depth"] == pytest.approx(2.0, rel=0.2)
    assert across == pytest.approx(0.2, rel=0.3)


@pytest.mark.parametrize("scale", [0.2, 1.0, 7.0])
def test_an_unknown_scale_is_found_with_x(scale: float) -> None:
    rng = np.random.default_rng(5)
    robot, seen = poses(rng, 0.4 * rng.standard_normal((20, 3)), "eye-in-hand")
    seen[:, :3, 3] *= scale
    found = solve_hand_eye_poses("eye-in-hand", robot, seen, metric=False)
    assert found.scale == pytest.approx(scale, rel=1e-3)
    off = inverse(X) @ found.mount_T_camera
    assert np.linalg.norm(off[:3, 3]) < 0.5


def test_a_camera_that_turns_on_the_spot_determines_no_scale() -> None:
    rng = np.random.default_rng(5)
    turns = transform(rotation_from_vector(0.4 * rng.standard_normal((15, 3))), np.zeros((15, 3)))
    seen = seen_with(rng, turns, 1e-3, 0.3, 0.3)
    with pytest.raises(UndeterminedError, match="how long its millimetres are"):
        solve_hand_eye_poses("eye-in-hand", Y @ inverse(X @ turns), seen, metric=False)


def test_a_camera_that_drifts_is_distinguished_from_one_that_scatters() -> None:
    rng = np.random.default_rng(2)
    robot, seen = far_target(rng, 40)
    steps = transform(rotation_from_vector(2e-3 * rng.standard_normal((40, 3))), rng.standard_normal((40, 3)))
    walked, wandered = np.eye(4), []
    for pose, step in zip(inverse(seen), steps, strict=True):
        walked = walked @ pose @ step @ inverse(pose)
        wandered.append(walked @ pose)
    found = solve_hand_eye_poses("eye-in-hand", robot, inverse(np.array(wandered)))
    assert found.camera == "drifting"
    assert found.deviations["drift rotation"] == pytest.approx(2e-3, rel=0.4)
    error = np.linalg.norm((inverse(X) @ found.mount_T_camera)[:3, 3])
    assert error < 4 * np.sqrt(np.trace(found.covariance[3:6, 3:6]))


def test_a_pose_that_is_no_number_is_named() -> None:
    rng = np.random.default_rng(0)
    robot, seen = poses(rng, 0.4 * rng.standard_normal((8, 3)), "eye-in-hand")
    seen[5, 0, 3] = np.nan
    with pytest.raises(UndeterminedError, match="camera's pose 6"):
        solve_hand_eye_poses("eye-in-hand", robot, seen)


def test_exact_poses_whose_residuals_are_zero_to_the_last_bit_are_no_trouble() -> None:
    turns = np.array([[[0, -1, 0], [1, 0, 0], [0, 0, 1]], [[1, 0, 0], [0, 0, -1], [0, 1, 0]]], float)
    rotations = [
        np.eye(3),
        *turns,
        turns[0] @ turns[1],
        turns[1] @ turns[0],
        turns[0].T,
        turns[1].T,
        turns[0] @ turns[0],
    ]
    stands = np.array([transform(turn, [100.0 * k, 0.0, 0.0]) for k, turn in enumerate(rotations)])
    with np.errstate(over="raise", divide="raise", invalid="raise"):
        found = solve_hand_eye_poses("eye-in-hand", stands, inverse(stands))
    assert np.allclose(found.mount_T_camera, np.eye(4), atol=1e-6)
