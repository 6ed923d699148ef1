"""Several views of one part become one cloud in the base."""

import json
from pathlib import Path

import numpy as np
import pytest

from calibration.errors import DocumentError
from calibration.kinematics.robot_accuracy import RobotNoise
from calibration.transforms import Array, inverse, map_points, rotation_angle_rad
from registration.documents import RegistrationReportDocument
from registration.errors import CloudIOError, CloudUnsupported, ScanError
from registration.fusion.merging import Merge
from registration.fusion.overlap import agreement
from registration.fusion.pose_adjustment import refine_poses
from registration.io.reading import open_cloud
from registration.points.layout import XYZ_FLOAT32
from registration.points.surface import PointSample, Surface, sample_points
from registration.points.voxel_grid import VoxelGrid
from registration.scan import ScannerMount, register_views, sample_views
from registration.scan_folder import read_scan, register_scan, write_views
from tests.registration.clouds import RICH, cloud, xyz
from tests.registration.parts import FLANGE_T_CAMERA, HAND, bumpy, flat, poses, ticks, view_of, write_scan, wrong

pytestmark = pytest.mark.slow

NOISE = RobotNoise(0.3, float(np.deg2rad(0.03)))


def read(path: Path) -> Array:
    with open_cloud(path) as source:
        return np.concatenate([xyz(block) for block in source.blocks()])


def bumpy_scan(folder: Path, unit: str = "mm", errs: bool = True) -> tuple[list[Array], list[Array]]:
    """Eight views; gives the true and the said base_T_flange."""
    true = poses(8)
    said = [wrong(pose, 0.3, 0.03, index) if errs else pose for index, pose in enumerate(true)]
    clouds = [view_of(bumpy, pose @ FLANGE_T_CAMERA, index) for index, pose in enumerate(true)]
    write_scan(folder, clouds, said, unit)
    return true, said


def deviation(points: Array) -> float:
    """RMS of the height over the true surface, to first order along its normal."""
    x, y, z = points.T
    slope_x, slope_y = (bumpy(x + 0.01, y) - bumpy(x, y)) / 0.01, (bumpy(x, y + 0.01) - bumpy(x, y)) / 0.01
    return float(np.sqrt(np.mean((z - bumpy(x, y)) ** 2 / (1 + slope_x**2 + slope_y**2))))


@pytest.mark.parametrize("unit", ["m", "mm"])
def test_the_plain_formula_puts_every_point_on_the_part(tmp_path: Path, unit: str) -> None:
    bumpy_scan(tmp_path, unit, errs=False)
    report = register_scan(read_scan(tmp_path), HAND, tmp_path / "merged.ply", ticks())
    points = read(tmp_path / "merged.ply")
    assert report.points == len(points) == 8 * 7000
    assert deviation(points) < 0.03
    assert report.rms_mm.before is not None
    assert report.rms_mm.before < 0.1
    assert report.verdict.accepted
    assert report.verdict.findings == []


def test_pixels_without_a_point_are_left_out_and_no_cluster_stands_where_the_camera_stood(tmp_path: Path) -> None:
    stands = poses(2)
    clouds = [view_of(flat, pose @ HAND.flange_T_camera, seed) for seed, pose in enumerate(stands)]
    for points in clouds:
        points[::10] = 0
    write_scan(tmp_path, clouds, stands)
    report = register_scan(read_scan(tmp_path), HAND, tmp_path / "out.ply", ticks())
    merged = read(tmp_path / "out.ply")
    assert len(merged) == sum(len(points) * 9 // 10 for points in clouds)
    assert np.abs(merged[:, 2]).max() < 0.2
    assert ("points-not-finite", "info") in [(one.code, one.severity) for one in report.verdict.findings]


def test_views_can_be_written_one_by_one(tmp_path: Path) -> None:
    bumpy_scan(tmp_path, errs=False)
    views = read_scan(tmp_path)
    registration = register_views(views, sample_views(views), HAND)
    (tmp_path / "base").mkdir()
    written = write_views(registration.views, tmp_path / "base")
    assert [path.name for path in written] == [view.path.name for view in views]
    assert all(deviation(read(path)) < 0.03 for path in written)
    with pytest.raises(ScanError, match="holds the scan itself"):
        write_views(registration.views, tmp_path)


def test_refinement_halves_the_deviation_and_beats_the_robot(tmp_path: Path) -> None:
    true, said = bumpy_scan(tmp_path)
    hand = ScannerMount("calibration-1", FLANGE_T_CAMERA, NOISE)
    register_scan(read_scan(tmp_path), hand, tmp_path / "plain.ply", ticks())
    report = register_scan(read_scan(tmp_path), hand, tmp_path / "refined.ply", ticks(), refine=True)
    plain, refined = deviation(read(tmp_path / "plain.ply")), deviation(read(tmp_path / "refined.ply"))
    assert refined < 0.5 * plain
    assert report.rms_mm.after is not None
    assert report.rms_mm.before is not None
    assert report.rms_mm.after < 0.5 * report.rms_mm.before
    camera = [np.array(view.base_T_camera.transform()) for view in report.views]
    errors = [pose_errors(found @ inverse(FLANGE_T_CAMERA), pose) for found, pose in zip(camera, true, strict=True)]
    robot = [pose_errors(pose, truth) for pose, truth in zip(said, true, strict=True)]
    assert np.mean(errors, axis=0)[1] < 0.6 * np.mean(robot, axis=0)[1]
    assert [finding.code for finding in report.verdict.findings] == []


def test_a_part_that_moved_between_views_and_stray_points_do_not_pull_the_others(tmp_path: Path) -> None:
    true = poses(6)
    said = [wrong(pose, 0.3, 0.03, index) for index, pose in enumerate(true)]
    random = np.random.default_rng(0)
    clouds = []
    for index, pose in enumerate(true):
        base_T_camera = pose @ FLANGE_T_CAMERA
        points = map_points(base_T_camera, view_of(bumpy, base_T_camera, index))
        points[points[:, 0] > 35] += [
            0.0,
            0.0,
            1.5 * (index % 2),
        ]  # a fifth of the part moved
        strays = random.uniform([-60, -60, -30], [60, 60, 60], (200, 3))
        clouds.append(map_points(inverse(base_T_camera), np.concatenate([points, strays])))
    write_scan(tmp_path, clouds, said)
    hand = ScannerMount("calibration-1", FLANGE_T_CAMERA, NOISE)
    report = register_scan(read_scan(tmp_path), hand, tmp_path / "refined.ply", ticks(), refine=True)
    camera = [np.array(view.base_T_camera.transform()) for view in report.views]
    errors = [pose_errors(found @ inverse(FLANGE_T_CAMERA), pose) for found, pose in zip(camera, true, strict=True)]
    robot = [pose_errors(pose, truth) for pose, truth in zip(said, true, strict=True)]
    assert np.all(np.mean(errors, axis=0) < np.array([0.6, 0.8]) * np.mean(robot, axis=0))


def pose_errors(found: Array, truth: Array) -> tuple[float, float]:
    """(rotation in rad, error of the part's centre in mm)"""
    off = found @ inverse(truth)
    return float(rotation_angle_rad(off[:3, :3])), float(np.linalg.norm(off[:3, 3]))


def test_a_view_nobody_else_saw_keeps_the_robots_pose_and_says_so(tmp_path: Path) -> None:
    true = poses(3)
    clouds = [view_of(bumpy, pose @ FLANGE_T_CAMERA, index) for index, pose in enumerate(true)]
    clouds[2] = view_of(bumpy, true[2] @ FLANGE_T_CAMERA, 2, at=500.0)
    write_scan(tmp_path, clouds, [wrong(pose, 0.3, 0.03, index) for index, pose in enumerate(true)])
    report = register_scan(read_scan(tmp_path), HAND, tmp_path / "merged.ply", ticks(), refine=True)
    lonely = report.views[2]
    assert lonely.correction is not None
    assert np.abs([*lonely.correction.translation_mm, *lonely.correction.rotation_deg]).max() < 1e-12
    assert (lonely.overlap, lonely.rms_mm, len(lonely.free_directions)) == (0, None, 6)
    assert [finding.code for finding in report.verdict.findings] == ["view-alone"]


def test_a_plane_is_left_to_the_robot_where_it_slides() -> None:
    true = poses(4)
    said = [wrong(pose, 0.3, 0.03, index) for index, pose in enumerate(true)]
    surfaces = [Surface.of(view_of(flat, pose @ FLANGE_T_CAMERA, index)) for index, pose in enumerate(true)]
    said_cameras = [pose @ FLANGE_T_CAMERA for pose in said]
    result = refine_poses(surfaces, said_cameras, said, NOISE)
    after = [view.motion @ pose for view, pose in zip(result.corrections, said_cameras, strict=True)]
    tighter = agreement(surfaces, after).rms_mm, agreement(surfaces, said_cameras).rms_mm
    assert tighter[0] is not None
    assert tighter[1] is not None
    assert tighter[0] < 0.5 * tighter[1]
    for view in result.corrections:
        assert len(view.free) == 3
        assert abs(np.arctan2(view.motion[1, 0], view.motion[0, 0])) < 1e-4
        np.testing.assert_allclose(np.linalg.norm(view.free[:, [2, 3, 4]], axis=0), 1, atol=1e-3)


def test_a_view_far_off_is_reported(tmp_path: Path) -> None:
    true = poses(6)
    said = [pose.copy() for pose in true]
    said[3][:3, 3] += [1.0, -1.0, 2.5]
    clouds = [view_of(bumpy, pose @ FLANGE_T_CAMERA, index) for index, pose in enumerate(true)]
    write_scan(tmp_path, clouds, said)
    hand = ScannerMount("calibration-1", FLANGE_T_CAMERA, NOISE)
    report = register_scan(read_scan(tmp_path), hand, tmp_path / "merged.ply", ticks(), refine=True)
    found = {finding.code: finding.message for finding in report.verdict.findings}
    assert found["correction-unexplained"].startswith("views 4 ")


def test_the_report_has_the_shape_the_formats_promise(tmp_path: Path) -> None:
    bumpy_scan(tmp_path)
    report = register_scan(read_scan(tmp_path), HAND, tmp_path / "merged.ply", ticks(), refine=True)
    content = json.loads(report.model_dump_json())
    assert RegistrationReportDocument.model_validate(content) == report
    assert set(content) == {"schema_version", "calibration_id", "views", "points", "rms_mm", "seconds", "verdict"}
    assert set(content["rms_mm"]) == {"before", "after"}
    assert set(content["seconds"]) == {"read", "register", "write"}


def test_one_view_and_empty_views_are_scans_too(tmp_path: Path) -> None:
    write_scan(tmp_path, [view_of(bumpy, poses(1)[0], 0), np.empty((0, 3)), np.ones((1, 3))], poses(3))
    for refine in (False, True):
        views = read_scan(tmp_path)
        report = register_scan(views, HAND, tmp_path / "merged.ply", ticks(), refine=refine)
        assert report.points == 7001
        assert "view-empty" in {finding.code for finding in report.verdict.findings}
        assert register_scan(views[:1], HAND, tmp_path / "one.ply", ticks(), refine=refine).points == 7000


BROKEN_SCANS = [
    ('{"schema_version": 2, "setup": "eye-in-hand", "views": []}', DocumentError, "schema_version"),
    ('{"schema_version": 1, "setup": "eye-in-hand", "views": []}', ScanError, "no views"),
    ('{"schema_version": 1, "setup": "eye-in-hand", "views": [{"cloud": "a.ply"}]}', DocumentError, "unit: missing"),
    ("[", DocumentError, "not JSON"),
]


@pytest.mark.parametrize(("text", "error", "says"), BROKEN_SCANS)
def test_a_broken_scan_json_is_reported(tmp_path: Path, text: str, error: type[Exception], says: str) -> None:
    (tmp_path / "scan.json").write_text(text)
    with pytest.raises(error, match=says):
        read_scan(tmp_path)


def test_a_scan_without_its_files_is_reported(tmp_path: Path) -> None:
    with pytest.raises(CloudIOError, match=r"scan\.json: file: it cannot be opened"):
        read_scan(tmp_path)
    bumpy_scan(tmp_path)
    (tmp_path / "view_003.ply").unlink()
    with pytest.raises(CloudIOError, match=r"view_003\.ply"):
        register_scan(read_scan(tmp_path), HAND, tmp_path / "merged.ply", ticks())
    text = (tmp_path / "scan.json").read_text()
    (tmp_path / "scan.json").write_text(text.replace("view_003.ply", "../view_003.ply"))
    with pytest.raises(ScanError, match="leaves the folder"):
        read_scan(tmp_path)


def test_an_output_of_unknown_kind_is_refused_and_nothing_written(tmp_path: Path) -> None:
    bumpy_scan(tmp_path)
    before = sorted(tmp_path.iterdir())
    with pytest.raises(CloudUnsupported, match=r"'\.doc'"):
        register_scan(read_scan(tmp_path), HAND, tmp_path / "merged.doc", ticks())
    assert sorted(tmp_path.iterdir()) == before


def test_voxels_average_every_column() -> None:
    records = cloud(RICH, 20_000)
    for name in "xyz":
        records[name] = np.abs(records[name]) % 40
    grid = VoxelGrid(10.0, RICH)
    for start in range(0, len(records), 1700):
        grid.add(records[start : start + 1700])
    averages = np.concatenate([block.copy() for block in grid.blocks()])
    assert len(averages) == 64
    cells = np.floor(xyz(records) / 10).astype(int)
    for average in averages:
        cell = np.floor([average[name] for name in "xyz"])
        inside = (cells == np.floor(cell / 10)).all(axis=1)
        for name in ("x", "time", "red", "intensity"):
            assert average[name] == pytest.approx(records[name][inside].astype(float).mean(), rel=1e-5, abs=0.51)
        assert np.linalg.norm([average[name] for name in ("nx", "ny", "nz")]) == pytest.approx(1, abs=1e-5)


def test_voxels_that_cannot_be_are_reported() -> None:
    for edge_mm in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ScanError, match="voxel"):
            VoxelGrid(edge_mm, XYZ_FLOAT32)
    far = cloud(XYZ_FLOAT32, 3)
    far["x"][1], far["y"][2] = 1e12, np.nan
    with pytest.raises(ScanError, match="larger voxels"):
        VoxelGrid(1.0, XYZ_FLOAT32).add(far)


def test_a_merged_scan_on_a_voxel_grid_has_its_points_once(tmp_path: Path) -> None:
    bumpy_scan(tmp_path)
    report = register_scan(read_scan(tmp_path), HAND, tmp_path / "merged.ply", ticks(), merge=Merge(4.0))
    assert report.points == len(read(tmp_path / "merged.ply"))
    assert 800 < report.points < 4000


def test_a_sample_of_any_cloud_stays_small_and_even() -> None:
    sample = PointSample(1.0, limit=1000)
    for start in range(0, 100_000, 777):
        records = np.zeros(min(777, 100_000 - start), XYZ_FLOAT32.dtype)
        records["x"] = np.arange(start, start + len(records))
        sample.add(records, XYZ_FLOAT32)
    x = sample.points()[:, 0]
    assert len(x) == 1000
    assert np.all(np.diff(x) > 0)
    assert np.all(np.histogram(x, 10, (0, 100_000))[0] > 60)


def test_a_sample_of_a_raster_has_no_stripes() -> None:
    rows, columns = np.divmod(np.arange(200_000), 640)
    records = np.zeros(len(rows), XYZ_FLOAT32.dtype)
    records["x"], records["y"], records["z"] = columns, rows, 700
    surface = Surface.of(sample_points([records], XYZ_FLOAT32, 1.0, limit=20_000))
    assert len(surface.points) > 19_500
    assert np.abs(surface.normals[:, 2]).min() > 0.999
    assert surface.spacing_mm == pytest.approx(np.sqrt(10), rel=0.15)


def test_points_along_lines_have_no_normals() -> None:
    x, y = np.meshgrid(np.linspace(0, 50, 1001), np.arange(0, 50, 10.0))
    surface = Surface.of(np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 500.0)]))
    assert len(surface.points) == 0


def test_points_are_where_the_formula_says(tmp_path: Path) -> None:
    points = np.random.default_rng(3).normal([0, 0, 400], 50, (200, 3))
    write_scan(tmp_path, [points], poses(1))
    register_scan(read_scan(tmp_path), HAND, tmp_path / "merged.ply", ticks())
    expected = map_points(poses(1)[0] @ FLANGE_T_CAMERA, points)
    np.testing.assert_allclose(read(tmp_path / "merged.ply"), expected, rtol=0, atol=1e-3)
