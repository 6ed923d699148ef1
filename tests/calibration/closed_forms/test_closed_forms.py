"""Every closed form against truth, against the others, and against OpenCV where it has them."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calibration.closed_forms.registry import CLOSED_FORMS
from calibration.closed_forms.three_pose import solve_three_pose
from calibration.errors import GeometryError
from calibration.transforms import Array, difference, inverse, rotation_from_vector, transform

NAMES = list(CLOSED_FORMS)


def chain(seed: int, views: int, X: Array, noise: float = 0.0) -> tuple[Array, Array]:
    """anchor_T_mount and camera_T_target of a session; `noise` in units of 0.05 degrees and 0.2 mm."""
    rng = np.random.default_rng(seed)
    Y = transform(rotation_from_vector(rng.standard_normal(3)), 1000 * rng.standard_normal(3))
    turns = rotation_from_vector(0.5 * rng.standard_normal((views, 3)))
    camera_T_target = transform(turns, 80 * rng.standard_normal((views, 3)) + [0, 0, 500])
    anchor_T_mount = Y @ inverse(X @ camera_T_target)
    error = transform(
        rotation_from_vector(noise * np.radians(0.05) * rng.standard_normal((views, 3))),
        noise * 0.2 * rng.standard_normal((views, 3)),
    )
    return anchor_T_mount @ error, camera_T_target


ORDINARY_X = transform(rotation_from_vector([0.4, -0.8, 1.9]), [30.0, -70.0, 120.0])


@pytest.mark.parametrize("name", NAMES)
@settings(deadline=None)
@given(seed=st.integers(0, 10_000), vector=st.tuples(*[st.floats(-3, 3)] * 3))
def test_without_noise_every_method_finds_the_truth(name: str, seed: int, vector: tuple[float, float, float]) -> None:
    X = transform(rotation_from_vector(vector), [30.0, -70.0, 120.0])
    translation_mm, rotation_rad = difference(X, CLOSED_FORMS[name](*chain(seed, 6, X)))
    assert translation_mm < 1e-4
    assert rotation_rad < 1e-7


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("axis", range(3))
def test_a_camera_mounted_half_a_turn_round_is_no_trouble(name: str, axis: int) -> None:
    X = transform(rotation_from_vector(np.pi * np.eye(3)[axis]), [30.0, -70.0, 120.0])
    translation_mm, rotation_rad = difference(X, CLOSED_FORMS[name](*chain(3, 6, X)))
    assert translation_mm < 1e-6
    assert rotation_rad < 1e-9


@pytest.mark.parametrize("name", [name for name in NAMES if name != "three-pose"])
def test_with_noise_all_methods_agree_within_it(name: str) -> None:
    poses = chain(5, 20, ORDINARY_X, noise=1.0)
    translation_mm, rotation_rad = difference(ORDINARY_X, CLOSED_FORMS[name](*poses))
    assert translation_mm < 1.0
    assert np.degrees(rotation_rad) < 0.1


OPENCV = {"tsai": "TSAI", "park": "PARK", "horaud": "HORAUD", "daniilidis": "DANIILIDIS"}


@pytest.mark.skipif(not hasattr(cv2, "calibrateHandEye"), reason="this OpenCV has no calibrateHandEye (5.0 removed it)")
@pytest.mark.parametrize("name", OPENCV)
def test_opencv_says_the_same(name: str) -> None:
    anchor_T_mount, camera_T_target = chain(7, 15, ORDINARY_X, noise=0.1)
    rotation, translation = cv2.calibrateHandEye(
        list(anchor_T_mount[:, :3, :3]),
        list(anchor_T_mount[:, :3, 3]),
        list(camera_T_target[:, :3, :3]),
        list(camera_T_target[:, :3, 3]),
        method=getattr(cv2, f"CALIB_HAND_EYE_{OPENCV[name]}"),
    )
    theirs = transform(rotation, translation[:, 0])
    translation_mm, rotation_rad = difference(theirs, CLOSED_FORMS[name](anchor_T_mount, camera_T_target))
    assert translation_mm < 0.05
    assert np.degrees(rotation_rad) < 0.01


def test_the_seeds_equation_7_is_a_rotation_only_without_noise() -> None:
    assert solve_three_pose(*chain(2, 3, ORDINARY_X)).distance_from_rotation < 1e-12
    noisy = solve_three_pose(*chain(2, 3, ORDINARY_X, noise=1.0))
    assert 1e-4 < noisy.distance_from_rotation < 0.1
    assert np.allclose(noisy.camera_T_mount[:3, :3] @ noisy.camera_T_mount[:3, :3].T, np.eye(3))


def test_the_seeds_method_names_what_it_cannot_do() -> None:
    anchor_T_mount, camera_T_target = chain(2, 3, ORDINARY_X)
    still = anchor_T_mount.copy()
    still[1] = still[0]
    with pytest.raises(GeometryError, match="without a turn"):
        solve_three_pose(still, camera_T_target)
