"""The mock cell's door in twelve views with robot errors: distances from the true surface, plain and refined."""

import time

import numpy as np
from numpy.typing import NDArray

from calibration.kinematics.robot_accuracy import RobotNoise
from calibration.transforms import Array, difference, inverse, map_points, rotation_from_vector, skew, transform
from mock_robot.scene.part import DOOR
from mock_robot.scene.scanner_view import ScannerModel, scan
from mock_robot.truth.truth import CellTruth
from mock_robot.truth.truth_sheet import DISTANCE_MM
from registration.fusion.overlap import agreement
from registration.fusion.pose_adjustment import correction_of, refine_poses
from registration.points.layout import XYZ_FLOAT32
from registration.points.surface import Surface, sample_points

NOISE = RobotNoise(0.3, float(np.deg2rad(0.03)))
COLUMNS_MM = (-500.0, -300.0, -100.0, 100.0, 300.0, 500.0)
ROWS_MM = (-155.0, 155.0)


def door(seeds: int = 5) -> None:
    """One line per seed, and the median."""
    print("\nmock door, 12 views: RMS distance from the true surface, errors of the poses, RMS between views")
    print(
        f"{'':<9}{'plain':>8}{'refined':>9}{'ratio':>7}{'scanner':>9}{'at best':>9}"
        f"{'poses: robot':>19}{'refined':>19}{'between: plain':>16}{'refined':>9}"
    )
    ratios = [_one(seed) for seed in range(seeds)]
    print(f"{'median':<26}{np.median(ratios):7.2f}", flush=True)


def _one(seed: int) -> float:
    truth, random = CellTruth.from_seed(1), np.random.default_rng(seed)
    nominal = truth.nominal
    said = [
        nominal.base_T_part @ looking_at(x, y) @ inverse(nominal.mount_T_camera) for y in ROWS_MM for x in COLUMNS_MM
    ]
    true = [pose @ _error(random) for pose in said]
    part_T_base, x = inverse(truth.base_T_part), truth.flange_T_camera
    clouds = [scan(ScannerModel(), [part_T_base @ pose @ truth.flange_T_scanner], random) for pose in true]
    surfaces = [surface_of(points) for points in clouds]
    plain = [pose @ x for pose in said]
    began = time.perf_counter()
    found = refine_poses(surfaces, plain, said, NOISE)
    spent = time.perf_counter() - began
    refined = [correction.motion @ pose for correction, pose in zip(found.corrections, plain, strict=True)]
    off, on, best, least = (
        deviation_mm(surfaces, poses, part_T_base)
        for poses in (plain, refined, [pose @ x for pose in true], [pose @ x for pose in _at_best(said, true)])
    )
    before, after = (_pose_errors(poses, true, x) for poses in (plain, refined))
    between = [agreement(surfaces, poses).rms_mm or np.nan for poses in (plain, refined)]
    print(
        f"seed {seed:<4}{off:8.3f}{on:9.3f}{on / off:7.2f}{best:9.3f}{least:9.3f}"
        f"{before:>19}{after:>19}{between[0]:16.3f}{between[1]:9.3f}",
        flush=True,
    )
    if seed == 0:
        _open3d(surfaces, plain, part_T_base, spent)
    return on / off


def surface_of(points: NDArray[np.float32]) -> Surface:
    """A cloud (n, 3) as the registration samples it."""
    return Surface.of(sample_points([np.ascontiguousarray(points).view(XYZ_FLOAT32.dtype)[:, 0]], XYZ_FLOAT32, 1.0))


def looking_at(x: float, y: float) -> Array:
    """part_T_camera at normal incidence on the skin at (x, y)."""
    aim = np.array([x, y, float(DOOR.height(np.array(x), np.array(y)))])
    out = DOOR.normal(np.array([x]), np.array([y]))[0]
    down = np.cross(-out, [1.0, 0.0, 0.0])
    down /= np.linalg.norm(down)
    return transform(np.column_stack([np.cross(down, -out), down, -out]), aim + DISTANCE_MM * out)


def _at_best(said: list[Array], true: list[Array]) -> list[Array]:
    """The true poses moved by the one motion that cannot be observed.

    Perfectly aligned views can still move as a whole; only the robot's poses, with their error, determine where.
    """
    rows, values = [], []
    for pose, truth in zip(said, true, strict=True):
        translation_mm, rotation_rad = correction_of(truth @ inverse(pose), pose[:3, 3])
        rows += [np.hstack([-skew(pose[:3, 3]), np.eye(3)]) / NOISE.translation_mm]
        rows += [np.hstack([np.eye(3), np.zeros((3, 3))]) / NOISE.rotation_rad]
        values += [translation_mm / NOISE.translation_mm, rotation_rad / NOISE.rotation_rad]
    twist = -np.linalg.lstsq(np.concatenate(rows), np.concatenate(values), rcond=None)[0]
    common = transform(rotation_from_vector(twist[:3]), twist[3:])
    return [common @ truth for truth in true]


def _error(random: np.random.Generator) -> Array:
    rotation = rotation_from_vector(random.normal(0, NOISE.rotation_rad, 3))
    return transform(rotation, random.normal(0, NOISE.translation_mm, 3))


def deviation_mm(surfaces: list[Surface], poses: list[Array], part_T_base: Array) -> float:
    """RMS distance of the samples from the true skin."""
    off = [
        DOOR.deviation(map_points(part_T_base @ pose, surface.points[::5]))
        for pose, surface in zip(poses, surfaces, strict=True)
    ]
    return float(np.sqrt(np.mean(np.concatenate(off) ** 2)))


def _pose_errors(poses: list[Array], true: list[Array], x: Array) -> str:
    errors = [difference(pose @ inverse(x), truth) for pose, truth in zip(poses, true, strict=True)]
    translation_mm, rotation_rad = np.sqrt(np.mean(np.square(errors), axis=0))
    return f"{translation_mm:.2f} mm {np.rad2deg(rotation_rad):.3f} deg"


def _open3d(surfaces: list[Surface], poses: list[Array], part_T_base: Array, spent: float) -> None:
    """Open3D's multiway registration: point-to-plane pairs, its information matrices, global optimization."""
    try:
        import open3d
    except (ImportError, OSError):  # installed it may still lack the system's libusb or libGL
        return
    began = time.perf_counter()
    pipeline = open3d.pipelines.registration
    clouds = []
    for surface, pose in zip(surfaces, poses, strict=True):
        cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(map_points(pose, surface.points)))
        cloud.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(14))
        clouds.append(cloud)
    graph = pipeline.PoseGraph()
    for _ in clouds:
        graph.nodes.append(pipeline.PoseGraphNode(np.eye(4)))
    for one in range(len(clouds)):
        for two in range(one + 1, len(clouds)):
            found = pipeline.registration_icp(
                clouds[one], clouds[two], 4.0, np.eye(4), pipeline.TransformationEstimationPointToPlane()
            )
            if found.fitness < 0.05:
                continue
            information = pipeline.get_information_matrix_from_point_clouds(
                clouds[one], clouds[two], 4.0, found.transformation
            )
            graph.edges.append(pipeline.PoseGraphEdge(one, two, found.transformation, information, uncertain=False))
    pipeline.global_optimization(
        graph,
        pipeline.GlobalOptimizationLevenbergMarquardt(),
        pipeline.GlobalOptimizationConvergenceCriteria(),
        pipeline.GlobalOptimizationOption(4.0, 0.25, 2.0, 0),
    )
    theirs = time.perf_counter() - began
    placed = [node.pose @ pose for node, pose in zip(graph.nodes, poses, strict=True)]
    off = deviation_mm(surfaces, placed, part_T_base)
    between = agreement(surfaces, placed).rms_mm or np.nan
    print(
        f"         (seed 0: Open3D's multiway took {theirs / spent:.1f} times as long; its cloud is {off:.3f} mm off, "
        f"{between:.3f} mm between views)",
        flush=True,
    )
