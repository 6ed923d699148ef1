"""X from a sphere: found among clutter, solved, refused when the views do not tell."""

from pathlib import Path

import numpy as np
import pytest

from calibration.errors import UndeterminedError
from calibration.transforms import Array, difference, inverse, map_points, transform
from registration.calibrate.sphere_solver import SphereSolution, solve_from_sphere
from registration.errors import SphereError
from registration.points.sphere_fit import find_artefact, fit_sphere
from registration.scan import ScannerMount, register_views, sample_views
from registration.scan_folder import read_scan
from tests.registration.parts import FLANGE_T_CAMERA
from tests.registration.spheres import CENTRE_IN_BASE, cap, looks


def test_a_sphere_is_found_among_clutter() -> None:
    random = np.random.default_rng(1)
    table = np.column_stack([random.uniform(-100, 100, (3000, 2)), np.full(3000, 400.0)])
    stray = random.uniform(-100, 100, (800, 3)) + np.array([0.0, 0.0, 330.0])
    centre = np.array([10.0, -5.0, 340.0])
    points = np.concatenate([table, cap(centre, 30.0), stray, np.full((5, 3), np.nan)])
    for fit in (fit_sphere(points, 30.0), fit_sphere(points), find_artefact(points, 30.0)):
        np.testing.assert_allclose(fit.centre, centre, rtol=0, atol=0.03)
        assert fit.radius_mm == pytest.approx(30, abs=0.03)
    assert fit_sphere(points, 30.0).sigma_mm == pytest.approx(0.05, rel=0.2)


def test_the_centres_covariance_is_what_repetition_shows() -> None:
    centre = np.array([0.0, 0.0, 300.0])
    fits = [fit_sphere(cap(centre, 40.0, seed, noise_mm=0.2, count=1000), 40.0) for seed in range(40)]
    spread = np.std([fit.centre for fit in fits], axis=0)
    promised = np.sqrt(np.diag(fits[0].covariance) / 12)
    np.testing.assert_allclose(spread, promised, rtol=0.5)


@pytest.mark.parametrize(
    ("points", "radius_mm", "says"),
    [
        (np.zeros((10, 3)), 30.0, "too few"),
        (cap(np.array([0.0, 0, 300]), 30.0), -1.0, "radius"),
        (cap(np.array([0.0, 0, 300]), 30.0), 90.0, "radius"),
        (cap(np.array([0.0, 0, 0.3]), 0.03, noise_mm=0), 30.0, "unit"),
        (np.zeros((500, 3)), 30.0, "radius"),
        (np.random.default_rng(0).uniform(-500, 500, (2000, 3)), 30.0, "radius"),
        (cap(np.array([0.0, 0, 300]), 31.0), 30.0, "radius of 31"),
    ],
)
def test_what_is_no_such_sphere_is_reported(points: Array, radius_mm: float, says: str) -> None:
    with pytest.raises(SphereError, match=says):
        find_artefact(points, radius_mm)


def centre_of(base_T_flange: Array, noise_mm: float = 0.0, seed: int = 0) -> Array:
    centre = map_points(inverse(base_T_flange @ FLANGE_T_CAMERA), CENTRE_IN_BASE[None])[0]
    noisy: Array = centre + np.random.default_rng(seed).normal(0, noise_mm, 3)
    return noisy


def solve(poses: list[Array], noise_mm: float = 0.0) -> SphereSolution:
    centres = [centre_of(pose, noise_mm, index) for index, pose in enumerate(poses)]
    return solve_from_sphere(np.array(centres), np.array(poses))


def test_exact_views_give_exactly_x() -> None:
    solution = solve(looks(7))
    translation_mm, rotation_rad = difference(solution.mount_T_camera, FLANGE_T_CAMERA)
    assert translation_mm < 1e-5
    assert rotation_rad < 1e-7
    np.testing.assert_allclose(solution.anchor_centre_mm, CENTRE_IN_BASE, rtol=0, atol=1e-5)


@pytest.mark.slow
def test_the_stated_uncertainty_is_the_real_one() -> None:
    errors, promised = [], []
    for trial in range(30):
        poses = looks(9, seed=2)
        centres = [centre_of(pose, 0.3, 100 * trial + index) for index, pose in enumerate(poses)]
        solution = solve_from_sphere(np.array(centres), np.array(poses))
        errors.append(difference(solution.mount_T_camera, FLANGE_T_CAMERA))
        deviations = np.sqrt(np.diag(solution.covariance))
        promised.append((np.linalg.norm(deviations[3:]), np.linalg.norm(deviations[:3])))
    real = np.sqrt(np.mean(np.square(errors), axis=0))
    np.testing.assert_allclose(real, np.mean(promised, axis=0), rtol=0.35)


def test_one_wrong_pose_is_left_out() -> None:
    poses = looks(9)
    centres, reported = [centre_of(pose, 0.1, index) for index, pose in enumerate(poses)], np.array(poses)
    reported[4, 0, 3] += 25
    solution = solve_from_sphere(np.array(centres), reported)
    assert solution.used == (0, 1, 2, 3, 5, 6, 7, 8)
    assert solution.spread_mm.max() < 0.2
    assert solution.left_out_mm is not None
    assert len(solution.left_out_mm) == 8


def same_place(count: int) -> list[Array]:
    """The sphere always at the same place of the picture: X's rotation cannot be told."""
    poses = []
    for pose in looks(count):
        turned = transform(pose[:3, :3], np.zeros(3)) @ FLANGE_T_CAMERA
        poses.append(transform(pose[:3, :3], CENTRE_IN_BASE - map_points(turned, np.array([[0, 0, 320.0]]))[0]))
    return poses


@pytest.mark.parametrize(
    ("poses", "noise_mm"),
    [
        (looks(3), 0.0),
        (same_place(8), 0.2),
        (looks(8, tilt=0.0), 0.2),
        ([looks(1)[0]] * 8, 0.2),
        (looks(8, tilt=0.01), 0.3),
    ],
)
def test_views_that_do_not_fix_x_are_refused(poses: list[Array], noise_mm: float) -> None:
    with pytest.raises(UndeterminedError):
        solve(poses, noise_mm)


@pytest.mark.data
@pytest.mark.slow
def test_nine_real_views_of_a_sphere(real_data: Path) -> None:
    views = read_scan(real_data / "reghec_sphere")
    samples = sample_views(views)
    fits = [find_artefact(sample.surface.points, 48.37) for sample in samples]
    centres, poses = [fit.centre for fit in fits], [view.base_T_flange for view in views]
    solution = solve_from_sphere(np.array(centres), np.array(poses))
    assert np.all(solution.spread_mm <= [0.50, 0.69, 0.61])
    assert solution.left_out_mm is not None
    assert solution.left_out_mm.max() < 3


@pytest.mark.data
@pytest.mark.slow
def test_a_real_object_of_nine_views_comes_together(real_data: Path) -> None:
    spheres = read_scan(real_data / "reghec_sphere")
    fits = [find_artefact(sample.surface.points, 48.37) for sample in sample_views(spheres)]
    centres, poses = [fit.centre for fit in fits], [view.base_T_flange for view in spheres]
    x = solve_from_sphere(np.array(centres), np.array(poses))
    views = read_scan(real_data / "reghec_duck")
    registration = register_views(views, sample_views(views), ScannerMount("sphere", x.mount_T_camera), refine=True)
    assert registration.before.rms_mm is not None
    assert 0.6 < registration.before.rms_mm < 0.9
    assert registration.after is not None
    assert registration.after.rms_mm is not None
    assert registration.after.rms_mm <= 0.25
