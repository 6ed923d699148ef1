"""The predicted covariance is the inverse of the information, and the information is the model's."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.likelihood.predicted_uncertainty import Scene, observe_whole_target, predict
from calibration.planning.viewpoints import flange_poses, random_viewpoints
from calibration.transforms import Array, inverse, map_points, rotation_from_vector, transform
from tests.calibration.planning.scenes import GOOD_NOISE, WIDE, seed_poses, seed_scene


def step(v: Array) -> Array:
    return transform(rotation_from_vector(v[:3]), v[3:])


def by_brute_force(scene: Scene, poses: Array) -> Array:
    """Covariance of X from differences of the forward model in X, target, lens, size and shape, every robot pose."""
    n, nuisances = len(poses), scene.nuisances
    shared = 12 + len(nuisances)
    seen = observe_whole_target(scene, poses)

    def pixels(v: Array) -> Array:
        z = v[12:shared]
        camera, points = nuisances.camera_at(z), nuisances.seen_at(seen, z).points_mm
        result = []
        for i, base_T_flange in enumerate(poses):
            moved = base_T_flange @ step(v[shared + 6 * i :][:6])
            anchor_T_mount = moved if scene.setup == "eye-in-hand" else inverse(moved)
            view = inverse(anchor_T_mount @ scene.mount_T_camera @ step(v[:6])) @ scene.anchor_T_target @ step(v[6:12])
            result.append(camera.project(map_points(view, points[i])).ravel())
        return np.concatenate(result)

    pose = [1e-6] * 3 + [1e-3] * 3
    lens = [1e-3] * 4 + [1e-6] * 5 if scene.intrinsics_free else [1e-6] + [1e-3] * 3
    steps = np.array(2 * pose + lens + [1e-6] * 3 + [1e-3] * 3 + n * pose)
    columns = [(pixels(h * e) - pixels(-h * e)) / (2 * h) for h, e in zip(steps, np.eye(len(steps)), strict=True)]
    jacobian = np.column_stack(columns) / scene.noise.image_px
    information = jacobian.T @ jacobian
    information[:shared, :shared] += scene.prior_information()
    prior = np.repeat([scene.noise.robot_rotation_rad, scene.noise.robot_translation_mm], 3) ** -2.0
    information[shared:, shared:] += np.diag(np.tile(prior, n))
    scale = np.sqrt(np.diag(information))
    return np.linalg.inv(information / np.outer(scale, scale))[:6, :6] / np.outer(scale, scale)[:6, :6]


@pytest.mark.parametrize("setup", ["eye-in-hand", "eye-to-hand"])
@pytest.mark.parametrize("intrinsics_free", [False, True])
def test_the_prediction_is_the_inverse_of_the_whole_information(setup, intrinsics_free):
    scene = replace(seed_scene(intrinsics_free=intrinsics_free), setup=setup)
    viewpoints = random_viewpoints(WIDE, 5, np.random.default_rng(3))
    poses = flange_poses(scene, viewpoints)
    predicted = predict(scene, poses).covariance
    expected = by_brute_force(scene, poses)
    scale = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(predicted / np.outer(scale, scale), expected / np.outer(scale, scale), atol=2e-4)


def test_the_seeds_three_poses_leave_a_registered_point_uncertain_by_more_than_a_centimetre():
    predicted = predict(seed_scene(), seed_poses())
    assert 15.0 < predicted.point_mm < 19.0


def test_poses_that_do_not_determine_x_are_predicted_as_infinite():
    same = np.repeat(seed_poses()[:1], 4, axis=0)
    assert predict(seed_scene(), same).point_mm == np.inf


def test_twice_the_noise_is_less_than_twice_the_uncertainty_since_lens_and_size_are_unknown_as_well():
    twice = replace(
        GOOD_NOISE,
        image_px=2 * GOOD_NOISE.image_px,
        robot_rotation_rad=2 * GOOD_NOISE.robot_rotation_rad,
        robot_translation_mm=2 * GOOD_NOISE.robot_translation_mm,
    )
    ratio = predict(seed_scene(twice), seed_poses()).point_mm / predict(seed_scene(), seed_poses()).point_mm
    assert 1.9 < ratio < 2.0 - 1e-3


def test_translation_is_predicted_along_the_mounts_axes_as_solve_reports_it() -> None:
    scene = seed_scene()
    found = predict(scene, seed_poses())
    mount_R_camera = scene.mount_T_camera[:3, :3]
    along_mount = np.diagonal(mount_R_camera @ found.covariance[3:, 3:] @ mount_R_camera.T)
    np.testing.assert_allclose(found.translation_mm**2, along_mount)
    assert found.translation_mm.max() > 1.2 * np.sqrt(np.diagonal(found.covariance)[3:]).min()
