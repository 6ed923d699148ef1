"""Lenses beyond five coefficients: given ones are used as they are, the rational one is estimated where needed."""

import numpy as np
import pytest

from calibration.camera import CameraModel, LensModel
from calibration.intrinsics.estimate import estimate_camera
from calibration.kinematics.stance import Stance
from calibration.problem import Detection, Problem, View
from calibration.solve import solve_hand_eye
from calibration.targets import Chessboard
from calibration.transforms import Array, difference, inverse, map_points, rotation_from_vector, transform

BOARD = Chessboard(12, 9, 25.0)
MATRIX = np.array([[900.0, 0.0, 955.5], [0.0, 900.0, 599.5], [0.0, 0.0, 1.0]])
WIDE_MATRIX = MATRIX * [[2 / 3, 1, 1], [1, 2 / 3, 1], [1, 1, 1]]
SIZE = (1920, 1200)
SIMPLE = [-0.12, 0.1, 2e-4, -3e-4, 0.0]
RATIONAL = [0.45, 0.04, 2e-4, -3e-4, 0.002, 0.85, 0.16, 0.01]
WHOLE = [*RATIONAL, 8e-4, -2e-4, -6e-4, 1e-4, 0.01, -0.02]
FISHEYE = [0.03, -0.01, 0.004, -0.001]
NEAR = 1.5
"""The wide lens sees the board as large from this many times nearer."""
FLANGE_T_CAMERA = transform(rotation_from_vector([0.1, -0.2, 1.4]), [35.0, -20.0, 90.0])
BASE_T_TARGET = transform(rotation_from_vector([3.1, 0.1, 0.0]), [900.0, 50.0, 100.0])


def poses(count: int, seed: int, nearness: float = 1.0) -> list[Array]:
    """camera_T_target: tilted up to 40 degrees, the board all over the image."""
    rng, middle, result = np.random.default_rng(seed), BOARD.points_mm.mean(axis=0), []
    for _ in range(count):
        turn = rotation_from_vector([*rng.uniform(-0.7, 0.7, 2), rng.uniform(-3, 3)])
        result.append(
            transform(turn, np.array([*rng.uniform(-130, 130, 2), rng.uniform(330, 480) / nearness]) - turn @ middle)
        )
    return result


def seen_by(camera: CameraModel, pose: Array, rng: np.random.Generator, noise_px: float) -> Detection:
    """The corners inside the image."""
    pixels = camera.project(map_points(pose, BOARD.points_mm))
    inside = np.flatnonzero(np.all((pixels > 0) & (pixels < np.array(SIZE) - 1), axis=1))
    return Detection(inside, pixels[inside] + rng.normal(0, noise_px, (len(inside), 2)))


def detections(
    camera: CameraModel, count: int, seed: int, noise_px: float = 0.05, nearness: float = 1.0
) -> list[Detection]:
    rng = np.random.default_rng(seed)
    return [seen_by(camera, pose, rng, noise_px) for pose in poses(count, seed, nearness)]


def prediction_errors_px(found: CameraModel, truth: CameraModel, seed: int) -> Array:
    """Distances of predicted corners from true ones, in views that took no part."""
    errors = []
    for pose in poses(20, seed, NEAR):
        points = map_points(pose, BOARD.points_mm)
        seen = seen_by(truth, pose, np.random.default_rng(0), 0.0)
        errors.append(np.hypot(*(found.project(points[seen.ids]) - seen.corners_px).T))
    return np.concatenate(errors)


@pytest.mark.parametrize("seed", range(3))
def test_a_lens_that_needs_eight_coefficients_gets_them(seed: int) -> None:
    truth = CameraModel(WIDE_MATRIX, np.array(RATIONAL), SIZE)

    found = estimate_camera(BOARD, detections(truth, 16, seed, nearness=NEAR), SIZE)

    assert len(found.camera.distortion) == 8
    assert found.covariance.shape == (12, 12)
    assert found.rms_px == pytest.approx(0.05, rel=0.05)
    assert np.percentile(prediction_errors_px(found.camera, truth, seed + 100), 95) < 0.15


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("coefficients", [SIMPLE, [0.0] * 5], ids=["simple", "none"])
def test_a_simple_lens_keeps_five(coefficients: list[float], seed: int) -> None:
    truth = CameraModel(MATRIX, np.array(coefficients), SIZE)

    found = estimate_camera(BOARD, detections(truth, 12, seed), SIZE)

    assert len(found.camera.distortion) == 5
    assert found.covariance.shape == (9, 9)


def problem(camera: CameraModel, given: CameraModel | None, nearness: float = 1.0) -> Problem:
    rng, views = np.random.default_rng(4), []
    for index, pose in enumerate(poses(14, 4, nearness)):
        base_T_flange = BASE_T_TARGET @ inverse(pose) @ inverse(FLANGE_T_CAMERA)
        off = transform(rotation_from_vector(rng.normal(0, 2e-4, 3)), rng.normal(0, 0.05, 3))
        views.append(View(index, Stance(base_T_flange @ off), seen_by(camera, pose, rng, 0.05)))
    return Problem("eye-in-hand", BOARD, given, SIZE, tuple(views))


@pytest.mark.parametrize(
    ("model", "coefficients"),
    [("pinhole", RATIONAL), ("pinhole", WHOLE[:12]), ("pinhole", WHOLE), ("fisheye", FISHEYE)],
    ids=["8", "12", "14", "fisheye"],
)
def test_sessions_of_given_lenses_are_solved(model: LensModel, coefficients: list[float]) -> None:
    camera = CameraModel(MATRIX, np.array(coefficients), SIZE, model)

    solution = solve_hand_eye(problem(camera, camera))

    assert solution.mount_T_camera is not None and solution.noise.image_px is not None
    translation_mm, rotation_rad = difference(solution.mount_T_camera, FLANGE_T_CAMERA)
    assert translation_mm < 0.15 and rotation_rad < 5e-4
    assert solution.noise.image_px == pytest.approx(0.05, rel=0.1)
    assert not [finding.code for finding in solution.findings if finding.severity == "error"]


def test_a_session_whose_lens_needs_eight_is_solved_without_intrinsics() -> None:
    solution = solve_hand_eye(problem(CameraModel(WIDE_MATRIX, np.array(RATIONAL), SIZE), None, NEAR))

    assert solution.camera is not None and len(solution.camera.distortion) == 8
    assert solution.mount_T_camera is not None and solution.noise.image_px is not None
    assert difference(solution.mount_T_camera, FLANGE_T_CAMERA)[0] < 0.3
    assert solution.noise.image_px == pytest.approx(0.05, rel=0.1)


@pytest.mark.parametrize(("model", "coefficients"), [("pinhole", WHOLE), ("fisheye", FISHEYE)], ids=["14", "fisheye"])
def test_wrong_given_intrinsics_are_named_whatever_the_lens(model: LensModel, coefficients: list[float]) -> None:
    camera = CameraModel(MATRIX, np.array(coefficients), SIZE, model)
    wrong = CameraModel(MATRIX * [[1.03, 1, 1], [1, 1.03, 1], [1, 1, 1]], np.array(coefficients), SIZE, model)

    solution = solve_hand_eye(problem(camera, wrong))

    assert any("intrinsics" in finding.code or "intrinsics" in finding.message for finding in solution.findings)
