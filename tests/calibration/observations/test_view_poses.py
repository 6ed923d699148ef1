"""Both poses that one view of a plane allows."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calibration.errors import DetectionError
from calibration.observations.view_poses import target_pose
from calibration.problem import Detection
from calibration.targets import Chessboard
from calibration.transforms import difference, map_points, rotation_from_vector, transform
from tests.simulated.views import industrial_camera

CAMERA = industrial_camera(1600, 1200)
BOARD = Chessboard(9, 7, 20.0)
ALL = np.arange(63)


def seen(camera_T_target, noise_px=0.0, seed=0):
    pixels = CAMERA.project(map_points(camera_T_target, BOARD.points_mm))
    return Detection(ALL, pixels + np.random.default_rng(seed).normal(0, noise_px, pixels.shape))


@settings(deadline=None)
@given(
    st.tuples(st.floats(-0.8, 0.8), st.floats(-0.8, 0.8), st.floats(-3.1, 3.1)),
    st.tuples(st.floats(-120, 0), st.floats(-100, 0), st.floats(400, 900)),
)
def test_the_true_pose_is_the_better_one(rotation, translation):
    truth = transform(rotation_from_vector(rotation), translation)
    candidates = target_pose(CAMERA, BOARD, seen(truth))
    millimetres, radians = difference(candidates[0].camera_T_target, truth)
    assert millimetres < 1e-3
    assert radians < 1e-5
    assert candidates[0].rms_px < 1e-4
    assert [c.rms_px for c in candidates] == sorted(c.rms_px for c in candidates)


def test_exact_data_for_which_opencv_finds_no_number_has_a_pose_all_the_same():
    """The board's middle on the optical axis, tilted about one of its axes: IPPE takes the root of a rounding error."""
    for tilt in np.linspace(0.2, 0.7, 200):
        rotation = rotation_from_vector([tilt, 0.0, 0.0])
        truth = transform(rotation, np.array([0.0, 0.0, 420.0]) - rotation @ BOARD.points_mm.mean(axis=0))
        millimetres, radians = difference(target_pose(CAMERA, BOARD, seen(truth))[0].camera_T_target, truth)
        assert (millimetres, radians) == pytest.approx((0, 0), abs=1e-3), tilt


def test_a_board_far_away_has_two_poses_that_fit_almost_alike_and_one_is_true():
    truth = transform(rotation_from_vector([0.35, 0.2, 0.4]), [-60.0, -50.0, 9000.0])
    candidates = target_pose(CAMERA, BOARD, seen(truth, 0.05))
    assert len(candidates) == 2
    assert candidates[1].rms_px < 2 * candidates[0].rms_px
    assert min(np.degrees(difference(c.camera_T_target, truth)[1]) for c in candidates) < 8


@pytest.mark.parametrize(
    "detection",
    [
        Detection(ALL[:3], np.ones((3, 2))),
        Detection(ALL[:9], np.column_stack([np.linspace(0, 500, 9), np.full(9, 300.0)])),
        Detection(ALL, np.full((63, 2), np.nan)),
        Detection(ALL + 5, np.ones((63, 2))),
        Detection(np.zeros(63, int), np.ones((63, 2))),
    ],
    ids=["three points", "a line", "NaN", "unknown ids", "one id"],
)
def test_points_that_give_no_pose_are_refused(detection):
    with pytest.raises(DetectionError) as refusal:
        target_pose(CAMERA, BOARD, detection)
    assert refusal.value.code
    assert refusal.value.fix
