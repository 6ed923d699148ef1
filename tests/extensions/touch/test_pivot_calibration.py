"""The tip of a tool from poses about a fixed point: its place, its uncertainty, and poses that do not belong."""

import numpy as np
import pytest

from calibration.errors import GeometryError, UndeterminedError
from calibration.transforms import Array, rotation_from_vector, transform, transform_from_vector
from extensions.touch.mathematics.pivot_calibration import MIN_POSES, calibrate_tip

TIP = np.array([12.0, -35.0, 180.0])
POINT = np.array([1200.0, -400.0, 350.0])


def poses_about_a_point(rng: np.random.Generator, n: int, tilt_deg: float = 30.0, sigma_mm: float = 0.0) -> Array:
    """base_T_flange (n, 4, 4) with TIP at POINT but for errors of `sigma_mm` per axis; n >= 3 turns about two axes."""
    about = np.linspace(0, 2 * np.pi, n, endpoint=False) + rng.uniform(0, 0.3, n)
    tilts = np.radians(tilt_deg) * np.column_stack([np.cos(about), np.sin(about), np.zeros(n)])
    rotations = rotation_from_vector([np.pi, 0, 0]) @ rotation_from_vector(tilts)
    return transform(rotations, POINT - rotations @ TIP + rng.normal(0, sigma_mm, (n, 3)))


@pytest.mark.parametrize("n", [MIN_POSES, 6, 40])
@pytest.mark.parametrize("tilt_deg", [10.0, 30.0, 90.0])
def test_without_errors_tip_and_point_are_found(n: int, tilt_deg: float) -> None:
    found = calibrate_tip(poses_about_a_point(np.random.default_rng(n), n, tilt_deg))
    np.testing.assert_allclose(found.flange_tip_mm, TIP, atol=1e-8)
    np.testing.assert_allclose(found.base_point_mm, POINT, atol=1e-8)
    assert found.outliers == ()
    assert found.point_sigma_mm < 1e-8


def test_turning_the_base_or_the_flange_turns_the_answer_with_it() -> None:
    rng = np.random.default_rng(5)
    poses = poses_about_a_point(rng, 6, sigma_mm=0.2)
    base, flange = transform_from_vector(rng.normal(0, [1, 1, 1, 900, 900, 900], (2, 6)))
    before, after = calibrate_tip(poses), calibrate_tip(base @ poses @ flange)
    rotation = flange[:3, :3]
    np.testing.assert_allclose(rotation @ after.flange_tip_mm + flange[:3, 3], before.flange_tip_mm, atol=1e-8)
    np.testing.assert_allclose(rotation @ after.covariance @ rotation.T, before.covariance, atol=1e-10)
    np.testing.assert_allclose(base[:3, :3] @ before.base_point_mm + base[:3, 3], after.base_point_mm, atol=1e-8)
    np.testing.assert_allclose(before.base_residuals_mm @ base[:3, :3].T, after.base_residuals_mm, atol=1e-8)


@pytest.mark.parametrize("n", [MIN_POSES, 10])
def test_the_tip_errs_as_its_covariance_says(n: int) -> None:
    rng = np.random.default_rng(100 + n)
    found = [calibrate_tip(poses_about_a_point(rng, n, sigma_mm=0.3)) for _ in range(250)]
    within = np.mean([np.abs(one.flange_tip_mm - TIP) < 2 * np.sqrt(np.diag(one.covariance)) for one in found], axis=0)
    assert np.all((within > 0.91) & (within < 0.99)), within
    assert np.sqrt(np.mean([one.sigma_mm**2 for one in found])) == pytest.approx(0.3, rel=0.08)
    assert np.mean([one.outliers != () for one in found]) < 0.03


@pytest.mark.parametrize(("n", "wrong"), [(6, {3}), (8, {0, 5}), (12, {1, 2, 7}), (30, {0, 4, 9, 17, 23})])
def test_poses_that_touch_another_place_are_named(n: int, wrong: set[int]) -> None:
    rng = np.random.default_rng(n)
    poses = poses_about_a_point(rng, n, sigma_mm=0.1)
    poses[sorted(wrong), :3, 3] += [4.0, -3.0, 2.0]  # all by the same: they hide each other
    found = calibrate_tip(poses)
    assert set(found.outliers) == wrong
    assert np.linalg.norm(found.flange_tip_mm - TIP) < 0.5
    lengths = np.linalg.norm(found.base_residuals_mm, axis=1)
    assert lengths[~found.used].min() > 3 > 1 > lengths[found.used].max()


def test_of_four_poses_none_is_left_out_but_the_uncertainty_shows_the_wrong_one() -> None:
    poses = poses_about_a_point(np.random.default_rng(2), 4, sigma_mm=0.05)
    before = calibrate_tip(poses)
    poses[1, :3, 3] += [5.0, 0.0, 0.0]
    found = calibrate_tip(poses)
    assert found.outliers == ()
    assert found.point_sigma_mm > max(1.0, 10 * before.point_sigma_mm)


@pytest.mark.parametrize("turns", [
    np.zeros((6, 3)),
    np.column_stack([np.zeros(6), np.zeros(6), np.linspace(0, 2, 6)]),  # about one axis only
    np.random.default_rng(1).normal(0, 0.03, (6, 3)),
], ids=["none", "one-axis", "two-degrees"])  # fmt: skip
def test_poses_that_turn_too_little_are_refused(turns: Array) -> None:
    rotations = rotation_from_vector(turns)
    with pytest.raises(UndeterminedError, match="of the flange's axes") as refused:
        calibrate_tip(transform(rotations, POINT - rotations @ TIP))
    assert refused.value.code == "tip-turns-too-little"
    assert "two axes" in refused.value.fix


def test_an_outlier_that_alone_turns_is_kept_since_nothing_checks_it() -> None:
    rotations = rotation_from_vector(np.column_stack([np.zeros(6), np.zeros(6), np.linspace(0, 2, 6)]))
    rotations[5] = rotation_from_vector([0.6, 0.0, 0.0])
    poses = transform(rotations, POINT - rotations @ TIP)
    poses[5, 0, 3] += 8.0
    assert calibrate_tip(poses).outliers == ()


def test_too_few_poses_are_refused() -> None:
    with pytest.raises(UndeterminedError) as refused:
        calibrate_tip(poses_about_a_point(np.random.default_rng(0), 3))
    assert refused.value.code == "tip-too-few-poses"


def test_a_number_that_is_not_finite_is_refused() -> None:
    poses = poses_about_a_point(np.random.default_rng(0), 5)
    poses[2, 0, 3] = np.nan
    with pytest.raises(GeometryError):
        calibrate_tip(poses)


def test_poses_that_touch_no_common_point_or_lie_beyond_all_cells_are_refused() -> None:
    rng = np.random.default_rng(0)
    poses = poses_about_a_point(rng, 8)
    poses[:, :3, 3] += rng.normal(0, 400.0, (8, 3))
    with pytest.raises(GeometryError, match="one fixed point"):
        calibrate_tip(poses)
    poses[:, :3, 3] *= 1e300
    with pytest.raises(GeometryError, match="further away"):
        calibrate_tip(poses)
