"""Clouds lie on the true skin, with the noise that was asked for, and only what is visible is in them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from calibration.transforms import Array, inverse, map_points, rotation_from_vector, transform
from mock_robot.scene.part import DOOR, surface_samples
from mock_robot.scene.scanner_view import ScannerModel, cast, cloud_ply, scan
from mock_robot.truth.score import read_points
from mock_robot.truth.truth import CellTruth
from mock_robot.truth.truth_sheet import scan_poses_of

COARSE = ScannerModel(columns=160, rows=120, focal=240.0)


def looking_at(x: float, y: float, lean: tuple[float, float] = (0.0, 0.0), distance: float = 650.0) -> Array:
    """part_T_scanner aimed at the skin, leaning about the scanner's x and y there."""
    facing = np.diag([1.0, -1.0, -1.0])
    aim = np.array([x, y, float(DOOR.height(np.array(x), np.array(y)))])
    part_R_scanner = facing @ np.asarray(rotation_from_vector([*lean, 0.0]))
    return transform(part_R_scanner, aim - distance * part_R_scanner[:, 2])


def test_without_noise_every_point_lies_on_the_skin() -> None:
    pose = looking_at(200.0, -50.0, (0.3, -0.2))
    points = scan(replace(COARSE, noise_mm=0.0), [pose], np.random.default_rng(1))
    assert len(points) > 10_000
    assert points.dtype == np.float32
    assert np.abs(DOOR.deviation(map_points(pose, points))).max() < 1e-4


def test_noise_grows_with_the_distance_squared() -> None:
    for distance in (500.0, 700.0, 900.0):
        pose = looking_at(-150.0, -150.0, distance=distance)
        points = scan(replace(COARSE, noise_mm=0.1), [pose], np.random.default_rng(1))
        spread = DOOR.deviation(map_points(pose, points)).std()
        assert spread == pytest.approx(0.1 * (distance / 600.0) ** 2, rel=0.1)


@pytest.mark.parametrize("lean", [(0.0, 0.0), (0.9, 0.0), (-0.9, 0.3), (0.2, 1.0)])
def test_rays_stop_at_the_first_metal_as_small_steps_along_them_find_it(lean: tuple[float, float]) -> None:
    """Over the handle's recess, whose rim hides part of it from the side."""
    pose = looking_at(370.0, 20.0, lean)
    scanner = replace(COARSE, columns=40, rows=30, focal=150.0)
    rays = scanner.rays()
    distance, _ = cast(scanner, pose, rays)
    steps = np.arange(450.0, 1000.0, 0.25)
    for ray, found in zip(rays, distance, strict=True):
        points = pose[:3, 3] + steps[:, None] * (ray @ pose[:3, :3].T)
        below = points[:, 2] < DOOR.height(points[:, 0], points[:, 1])
        if np.isfinite(found):
            assert steps[np.argmax(below)] == pytest.approx(found, abs=0.26)


def test_the_recess_hides_part_of_itself_from_the_side() -> None:
    metal = surface_samples(2.0)
    recess = metal[(np.abs(metal[:, 0] - 370.0) < 60.0) & (np.abs(metal[:, 1] - 20.0) < 35.0)]
    all_angles = replace(COARSE, noise_mm=0.0, focal=960.0, columns=320, rows=240, fading_deg=(89.0, 89.9))
    shown = []
    for lean in (0.0, 1.2):
        pose = looking_at(370.0, 20.0, (lean, 0.0))
        points = map_points(pose, scan(all_angles, [pose], np.random.default_rng(1)))
        shown.append(np.mean(cKDTree(points).query(recess)[0] < 3.0))
    assert shown[0] == 1.0
    assert 0.3 < shown[1] < 0.95


def test_a_cut_out_gives_no_points() -> None:
    pose = looking_at(0.0, 180.0)
    points = map_points(pose, scan(replace(COARSE, noise_mm=0.0), [pose], np.random.default_rng(1)))
    assert len(points) > 1000
    assert DOOR.edge_distance(points[:, 0], points[:, 1]).max() < 1e-3


def test_steep_metal_fades_out() -> None:
    counts = [
        len(scan(COARSE, [looking_at(-150.0, -100.0, (0.0, np.radians(tilt)))], np.random.default_rng(1)))
        for tilt in (0.0, 63.0, 80.0)
    ]
    assert counts[0] > 2 * counts[1] > 20 * counts[2]


@pytest.mark.parametrize(
    "pose",
    [
        transform(np.eye(3), [0.0, 0.0, 600.0]),
        transform(np.diag([1.0, -1.0, -1.0]), [0.0, 0.0, -600.0]),
        looking_at(0.0, -150.0, distance=1500.0),
        looking_at(0.0, -150.0, distance=200.0),
        transform(np.asarray(rotation_from_vector([1.5707, 0.0, 0.0])), [0.0, 0.0, 10.0]),
    ],
    ids=["looking away", "behind the door", "too far", "too near", "along the skin"],
)
def test_where_nothing_can_be_measured_the_cloud_is_empty(pose: Array) -> None:
    assert len(scan(COARSE, [pose], np.random.default_rng(1))) == 0


def test_a_scan_in_motion_is_sheared() -> None:
    pose = looking_at(0.0, -150.0)
    later = transform(np.eye(3), [0.0, 0.0, 4.0]) @ pose
    points = scan(replace(COARSE, noise_mm=0.0), [pose, later], np.random.default_rng(1))
    deviation = DOOR.deviation(map_points(pose, points))
    assert np.percentile(np.abs(deviation), 25) < 1e-3
    assert np.percentile(np.abs(deviation), 75) > 3.0


def test_the_taught_views_together_cover_the_door_though_guess_and_rack_are_off() -> None:
    metal = surface_samples(10.0)
    for seed in (0, 1, 2):
        truth = CellTruth.from_seed(seed)
        views = [inverse(truth.base_T_part) @ pose @ truth.flange_T_scanner for pose in scan_poses_of(truth)]
        clouds = [map_points(view, scan(COARSE, [view], np.random.default_rng(1))) for view in views]
        distance, _ = cKDTree(np.concatenate(clouds)).query(metal)
        assert np.mean(distance < 6.0) > 0.99
        assert max(np.mean(cKDTree(cloud).query(metal)[0] < 6.0) for cloud in clouds) < 0.45, "no view shows it all"


def test_a_cloud_file_reads_back() -> None:
    points = np.array([[1.5, -2.25, 600.125], [0.0, 1.0, 2.0]], np.float32)
    assert np.array_equal(read_points(cloud_ply(points)), points)
    assert len(read_points(cloud_ply(points[:0]))) == 0
