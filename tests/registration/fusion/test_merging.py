"""Views as one cloud: blended, without strays, with normals."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calibration.transforms import Array
from registration.errors import CloudIOError, ScanError
from registration.fusion.large_grid import LargeVoxelGrid
from registration.fusion.merging import NORMALS, Merge, Merger
from registration.io.reading import open_cloud
from registration.points.hash_index import CellIndex
from registration.points.layout import XYZ_FLOAT32, Layout, Records
from registration.points.voxel_grid import VoxelGrid
from registration.scan_folder import read_scan, register_scan
from tests.registration.clouds import RICH, cloud, xyz
from tests.registration.parts import FLANGE_T_CAMERA, HAND, bumpy, poses, ticks, view_of, write_scan
from tests.support.cases import cases

CAMERA_MM = np.array([0.0, 0.0, 400.0])
STRAYS_MM = np.array([[200.0, 200, 90], [-150, 0, 70], [0, 0, -80]])


def sheet(seed: int = 0, strays: bool = False) -> Records:
    """A sheet with a bump, 200 mm wide, seen from above."""
    x, y = np.random.default_rng(seed).uniform(-100, 100, (2, 20_000))
    points = np.column_stack([x, y, 20 * np.exp(-(x**2 + y**2) / 2000)])
    points = np.concatenate([points, STRAYS_MM]) if strays else points
    return np.ascontiguousarray(points, "<f4").view(XYZ_FLOAT32.dtype)[:, 0]


def merged(merge: Merge, *views: Records, layout: Layout = XYZ_FLOAT32) -> tuple[Records, Merger]:
    merger = Merger(merge, layout, Path("never used"))
    blocks = list(merger.merge_views(((view[:9000], view[9000:]), CAMERA_MM) for view in views))
    return np.concatenate([*blocks, np.empty(0, merger.layout.dtype)]), merger


@settings(max_examples=cases(100), deadline=None)
@given(st.lists(st.lists(st.integers(0, 60) | st.integers(0, 2**62), max_size=400), max_size=6))
def test_equal_keys_have_one_number_and_others_another(pieces: list[list[int]]) -> None:
    index = CellIndex()
    numbers: dict[int, int] = {}
    for piece in pieces:
        found = index.numbers(np.array(piece, np.int64))
        for key, number in zip(piece, found.tolist(), strict=True):
            assert numbers.setdefault(key, number) == number
    assert sorted(numbers.values()) == list(range(len(numbers))) == list(range(len(index)))
    assert {key: number for number, key in enumerate(index.keys.tolist())} == numbers


def test_a_table_grows_without_forgetting() -> None:
    index, keys = CellIndex(), np.random.default_rng(0).integers(0, 1 << 62, 300_000)
    first = [index.numbers(piece) for piece in np.split(keys, 300)]
    assert np.array_equal(np.concatenate(first), index.numbers(keys))
    assert np.array_equal(index.keys[index.numbers(keys)], keys)


def test_the_bits_of_an_average_do_not_depend_on_the_blocks() -> None:
    records = cloud(RICH, 50_000)
    answers = []
    for size in (50_000, 777, 12_345):
        grid = VoxelGrid(100.0, RICH)
        for start in range(0, len(records), size):
            grid.add(records[start : start + size])
        answers.append(np.concatenate(list(grid.blocks())))
    assert answers[0].tobytes() == answers[1].tobytes() == answers[2].tobytes()


@pytest.mark.parametrize("most_cells", [40, 700])
def test_averages_beyond_the_memory_have_the_same_bits(tmp_path: Path, most_cells: int) -> None:
    records = cloud(RICH, 30_000)
    for name in "xyz":
        records[name] %= 400.0
    records = records[np.argsort(records["x"] + np.arange(len(records)) % 7, kind="stable")]
    known = VoxelGrid(20.0, RICH)
    known.add(records)
    with LargeVoxelGrid(20.0, RICH, tmp_path, most_cells) as grid:
        for start in range(0, len(records), 1700):
            grid.add(records[start : start + 1700])
        answer = np.concatenate(list(grid.blocks()))
        assert len(list(tmp_path.rglob("*"))) > 0
    assert answer.tobytes() == np.concatenate(list(known.blocks())).tobytes()
    assert len(answer) > 5 * most_cells
    assert list(tmp_path.iterdir()) == []


def test_a_merge_beyond_the_memory_leaves_no_files_when_it_is_stopped(tmp_path: Path) -> None:
    merger = Merger(Merge(2.0), XYZ_FLOAT32, tmp_path, most_cells=100)
    blocks = merger.merge_views([([sheet()], CAMERA_MM)])
    next(blocks)
    assert len(list(tmp_path.iterdir())) == 1
    blocks.close()  # type: ignore[attr-defined]
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_cannot_hold_the_points_is_named(tmp_path: Path) -> None:
    merger = Merger(Merge(2.0), XYZ_FLOAT32, tmp_path / "gone", most_cells=100)
    with pytest.raises(CloudIOError, match=r"temporary files of the merge cannot be created .*larger voxels"):
        list(merger.merge_views([([sheet()], CAMERA_MM)]))


def test_every_point_stays_unless_asked() -> None:
    answer, _ = merged(Merge(), sheet(0), sheet(1))
    assert answer.tobytes() == sheet(0).tobytes() + sheet(1).tobytes()


def test_what_two_views_saw_blends() -> None:
    once, _ = merged(Merge(5.0), sheet(0))
    twice, _ = merged(Merge(5.0), sheet(0), sheet(1))
    assert len(once) <= len(twice) < 1.05 * len(once)


@pytest.mark.parametrize("outliers", ["statistical", "radius"])
def test_strays_are_left_out_and_the_sheet_stays(outliers: str) -> None:
    kept, _ = merged(Merge(3.0), sheet(strays=True))
    answer, merger = merged(Merge(3.0, outliers=outliers), sheet(strays=True))  # type: ignore[arg-type]
    assert set(map(tuple, STRAYS_MM.tolist())) <= set(map(tuple, xyz(kept).tolist()))
    assert not set(map(tuple, STRAYS_MM.tolist())) & set(map(tuple, xyz(answer).tolist()))
    assert merger.averaged == len(kept)
    assert merger.left_out == len(kept) - len(answer)
    assert len(answer) > 0.9 * len(kept)


def test_normals_are_fitted_and_look_at_the_camera() -> None:
    answer, merger = merged(Merge(3.0, normals=True), sheet())
    points, normals = xyz(answer), xyz(answer, NORMALS)
    slope = -points[:, 2:] * points[:, :2] / 1000
    true = np.column_stack([-slope, np.ones(len(slope))])
    true /= np.linalg.norm(true, axis=1, keepdims=True)
    inside = np.abs(points[:, :2]).max(axis=1) < 90
    angle_deg = np.degrees(np.arccos(np.clip(np.sum(normals * true, axis=1), -1, 1)))[inside]
    assert merger.layout.normals == NORMALS
    assert np.median(angle_deg) < 1.5
    assert angle_deg.max() < 15


def test_measured_normals_are_averaged_not_fitted() -> None:
    records = cloud(RICH, 5000)
    fitted, merger = merged(Merge(50.0, normals=True), records, layout=RICH)
    plain, _ = merged(Merge(50.0), records, layout=RICH)
    assert merger.layout == RICH
    assert fitted.tobytes() == plain.tobytes()


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_hardly_any_points_are_merged_all_the_same(count: int) -> None:
    for outliers in ("keep", "statistical", "radius"):
        answer, _ = merged(Merge(1.0, True, outliers), sheet()[:count])  # type: ignore[arg-type]
        assert len(answer) == (0 if outliers == "radius" else count)
        assert np.isfinite(xyz(answer, NORMALS)).all()


def test_what_needs_averages_is_refused_without() -> None:
    for merge in ({"normals": True}, {"outliers": "radius"}):
        with pytest.raises(ScanError, match=r"no voxel is stated: state its edge"):
            Merge(**merge)  # type: ignore[arg-type]
    with pytest.raises(ScanError, match="outliers cannot be 'all'"):
        Merge(1.0, outliers="all")  # type: ignore[arg-type]


@pytest.mark.parametrize("suffix", [".ply", ".bin"])
def test_a_scan_is_written_whole_and_view_by_view(tmp_path: Path, suffix: str) -> None:
    true = poses(3)
    write_scan(tmp_path, [view_of(bumpy, pose @ FLANGE_T_CAMERA, index) for index, pose in enumerate(true)], true)
    (tmp_path / "views").mkdir()
    report = register_scan(
        read_scan(tmp_path),
        HAND,
        tmp_path / f"merged{suffix}",
        ticks(),  # type: ignore[arg-type]
        merge=Merge(4.0, normals=True, outliers="statistical"),
        views_out=tmp_path / "views",
    )
    whole = read(tmp_path / f"merged{suffix}")
    assert len(whole) == report.points
    assert "outliers-left-out" in [finding.code for finding in report.verdict.findings]
    assert sum(len(read(file)) for file in (tmp_path / "views").iterdir()) == sum(view.points for view in report.views)


def read(path: Path) -> Array:
    with open_cloud(path) as source:
        return np.concatenate([xyz(block) for block in source.blocks()])


@pytest.mark.parametrize("pieces", [1, 7])
def test_a_grid_of_limited_size_is_that_of_a_larger_edge(pieces: int) -> None:
    """On both sides of the origin, and however the points come."""
    points = sheet()
    limited, plain = VoxelGrid(1.0, XYZ_FLOAT32, most=900), VoxelGrid(8.0, XYZ_FLOAT32)
    for block in np.array_split(points, pieces):
        limited.add(block)
    plain.add(points)
    assert limited.edge_mm == 8.0
    assert len(limited) <= 900
    found, expected = (np.concatenate([*grid.blocks()]) for grid in (limited, plain))
    assert np.allclose(xyz(found), xyz(expected), atol=1e-4)


def test_at_most_so_many_points_are_merged() -> None:
    assert len(merged(Merge(1.0, most=900), sheet(), sheet(1))[0]) <= 900
    with pytest.raises(ScanError, match="no voxel is stated"):
        Merge(most=900)


def test_eight_voxels_are_the_fewest_and_seven_are_refused() -> None:
    """Doubling an edge joins no points on both sides of the origin, so that fewer would never be reached."""
    assert len(merged(Merge(1.0, most=8), sheet(), sheet(1))[0]) <= 8
    with pytest.raises(ScanError, match="want 8 or more"):
        Merge(1.0, most=7)
