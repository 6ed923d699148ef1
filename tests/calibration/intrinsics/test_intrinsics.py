"""The camera from views of a target: right, with honest deviations, and refused when the views do not tell."""

import numpy as np
import pytest

from calibration.camera import CameraModel
from calibration.detection.detect import detect
from calibration.errors import UndeterminedError
from calibration.intrinsics.estimate import estimate_camera
from calibration.problem import Detection
from calibration.targets import Chessboard
from calibration.transforms import difference, map_points, rotation_from_vector, transform
from tests.calibration.detection.sights import pictures
from tests.simulated.views import industrial_camera

CAMERA = industrial_camera(1600, 1200)
BOARD = Chessboard(9, 7, 20.0)
ALL = np.arange(63)
MIDDLE = BOARD.points_mm.mean(axis=0)


def poses(rng, count, tilt_deg=35.0):
    for _ in range(count):
        azimuth, tilt = rng.uniform(-np.pi, np.pi), np.radians(tilt_deg) * np.sqrt(rng.uniform(0.2, 1.0))
        turn = rotation_from_vector(tilt * np.array([np.cos(azimuth), np.sin(azimuth), 0.0]))
        turn = turn @ rotation_from_vector([0.0, 0.0, rng.uniform(-3, 3)])
        yield transform(turn, np.array([*rng.uniform(-50, 50, 2), rng.uniform(380, 520)]) - turn @ MIDDLE)


def views(camera, rng, count=10, noise_px=0.05, tilt_deg=35.0):
    for camera_T_target in poses(rng, count, tilt_deg):
        pixels = camera.project(map_points(camera_T_target, BOARD.points_mm))
        yield Detection(ALL, pixels + rng.normal(0, noise_px, pixels.shape))


def intrinsics(camera):
    return np.append(camera.matrix[[0, 1, 0, 1], [0, 1, 2, 2]], camera.distortion)


@pytest.mark.slow
def test_deviations_are_what_they_claim_to_be():
    rng = np.random.default_rng(0)
    normalised = []
    for _ in range(40):
        estimate = estimate_camera(BOARD, list(views(CAMERA, rng)), CAMERA.image_size)
        off = intrinsics(estimate.camera) - intrinsics(CAMERA)
        sigma = np.sqrt(np.diag(estimate.covariance))
        free = sigma > 0
        normalised.append(np.where(free, off / np.where(free, sigma, 1.0), np.nan))
        assert estimate.rms_px == pytest.approx(0.05, rel=0.1)
    deviation = np.nanstd(np.array(normalised)[:, :6], axis=0)
    assert np.all((deviation > 0.7) & (deviation < 1.35)), deviation


@pytest.mark.slow
def test_a_lens_without_distortion_gets_none():
    ideal = CameraModel(CAMERA.matrix, np.zeros(5), CAMERA.image_size)
    rng = np.random.default_rng(1)
    zeros = [
        np.count_nonzero(estimate_camera(BOARD, list(views(ideal, rng)), ideal.image_size).camera.distortion == 0)
        for _ in range(12)
    ]
    assert np.mean(zeros) > 4.7


def test_poses_come_with_it():
    rng = np.random.default_rng(2)
    truth = list(poses(rng, 6))
    detections = [Detection(ALL, CAMERA.project(map_points(pose, BOARD.points_mm))) for pose in truth]
    estimate = estimate_camera(BOARD, detections, CAMERA.image_size)
    for pose, true_pose in zip(estimate.camera_T_target, truth, strict=True):
        millimetres, radians = difference(pose, true_pose)
        assert millimetres < 0.05
        assert radians < 1e-4


def test_every_picture_of_a_small_board_counts():
    """A board of 1.5 mm pitch seldom moves by more than 1 mm in its pictures, whose robot poses nobody knows."""
    small, turns = Chessboard(9, 7, 1.5), np.linspace(0, 2 * np.pi, 12, endpoint=False)
    tilts = (rotation_from_vector(np.radians(22) * np.array([np.cos(one), np.sin(one), 0.0])) for one in turns)
    seen = [map_points(transform(tilt, [0, 0, 22.0]), small.points_mm - small.points_mm.mean(axis=0)) for tilt in tilts]
    noise = np.random.default_rng(0).normal(0, 0.05, (12, 63, 2))
    detections = [Detection(ALL, CAMERA.project(one) + off) for one, off in zip(seen, noise, strict=True)]
    assert len(estimate_camera(small, detections, CAMERA.image_size).positions) == 12


def test_views_and_points_that_contradict_the_rest_are_left_out():
    rng = np.random.default_rng(3)
    detections = list(views(CAMERA, rng, 12))
    wrong_columns = np.roll(ALL.reshape(7, 9), 1, axis=1).ravel()
    detections[4] = Detection(wrong_columns, detections[4].corners_px)
    detections[9] = Detection(ALL, rng.uniform(100, 1100, (63, 2)))
    detections[7].corners_px[10] += [4.0, -3.0]
    estimate = estimate_camera(BOARD, detections, CAMERA.image_size)
    assert set(estimate.positions) == set(range(12)) - {4, 9}
    sigma = np.sqrt(np.diag(estimate.covariance))
    off = np.abs(intrinsics(estimate.camera) - intrinsics(CAMERA))
    assert np.all(off[:6] < 5 * np.maximum(sigma[:6], 1e-9))


def test_a_view_counted_from_the_other_end_does_no_harm():
    detections = list(views(CAMERA, np.random.default_rng(4)))
    detections[3] = Detection(ALL[::-1], detections[3].corners_px)
    estimate = estimate_camera(BOARD, detections, CAMERA.image_size)
    assert len(estimate.positions) == 10
    assert abs(estimate.camera.matrix[0, 0] / CAMERA.matrix[0, 0] - 1) < 2e-3


@pytest.mark.parametrize("focal_of_width", [0.6, 1.0, 2.5, 6.0])
def test_wide_and_long_lenses(focal_of_width):
    matrix = np.array([[focal_of_width * 1600, 0, 810.0], [0, focal_of_width * 1600, 590.0], [0, 0, 1]])
    camera = CameraModel(matrix, np.zeros(5), (1600, 1200))
    rng = np.random.default_rng(5)
    detections = []
    for pose in poses(rng, 10, 40.0):
        pose[2, 3] *= focal_of_width
        pixels = camera.project(map_points(pose, BOARD.points_mm))
        detections.append(Detection(ALL, pixels + rng.normal(0, 0.03, pixels.shape)))
    estimate = estimate_camera(BOARD, detections, camera.image_size)
    sigma = np.sqrt(estimate.covariance[0, 0])
    assert abs(estimate.camera.matrix[0, 0] - matrix[0, 0]) < 4 * sigma


def nan_view():
    return Detection(ALL, np.full((63, 2), np.nan))


@pytest.mark.parametrize(
    ("detections", "code"),
    [
        ([], "too-few-views"),
        (list(views(CAMERA, np.random.default_rng(6), 2)), "too-few-views"),
        ([*views(CAMERA, np.random.default_rng(6), 2), nan_view(), nan_view()], "too-few-views"),
        ([Detection(ALL[:3], np.ones((3, 2)))] * 5, "too-few-views"),
        ([Detection(ALL[:9], np.random.default_rng(0).uniform(0, 900, (9, 2)))] * 5, "too-few-views"),
        (list(views(CAMERA, np.random.default_rng(7), 8, tilt_deg=0.0)), "no-tilt"),
        (list(views(CAMERA, np.random.default_rng(8), 5, tilt_deg=1.0)), "no-tilt"),
    ],
)
def test_what_cannot_be_determined_is_refused(detections, code):
    with pytest.raises(UndeterminedError) as refusal:
        estimate_camera(BOARD, detections, CAMERA.image_size)
    assert refusal.value.code == code


def test_from_pictures_to_the_camera():
    board = Chessboard(11, 8, 20.0)
    shots = pictures(board, 6)
    estimate = estimate_camera(board, [detect(shot.image, board) for shot in shots], CAMERA.image_size)
    assert estimate.rms_px < 0.016
    assert abs(estimate.camera.matrix[0, 0] - CAMERA.matrix[0, 0]) < 1.0
