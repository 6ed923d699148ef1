"""LAS, LAZ and E57, where their libraries are installed."""

import contextlib
import struct
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from registration.errors import CloudError, CloudFormatError, CloudUnsupported
from registration.io.convert import move_file
from registration.io.formats import extras
from registration.io.formats.las import SCALES
from registration.io.reading import open_cloud
from registration.io.writing import new_cloud
from registration.points.layout import XYZ_FLOAT32, Records
from registration.points.rigid_motion import RigidMotion
from tests.registration.clouds import BASE_T_CAMERA, RICH, cloud, moved, xyz
from tests.support.cases import cases

MOTION = RigidMotion.of(BASE_T_CAMERA, "mm")


def read(path: Path) -> Records:
    with open_cloud(path) as source:
        return np.concatenate([block.copy() for block in source.blocks()])


def las(path: Path, count: int) -> Any:
    laspy = pytest.importorskip("laspy", reason="laspy is not installed: LAS is not tested")
    records = cloud(XYZ_FLOAT32, count)
    content = laspy.create(point_format=3)
    content.header.scales, content.header.offsets = [0.001] * 3, [10, 20, 30]
    content.add_extra_dim(laspy.ExtraBytesParams("quality", "f4"))
    content.x, content.y, content.z = records["x"], records["y"], records["z"]
    content.intensity, content.red = np.arange(count) % 60000, np.arange(count) % 50000
    content.gps_time, content.quality = np.arange(count) / 7, np.arange(count) / 3
    content.write(str(path))
    return laspy.read(str(path))


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_las_is_read_in_blocks_with_every_dimension(tmp_path: Path, suffix: str) -> None:
    theirs = las(tmp_path / f"in{suffix}", 150_000)
    records = read(tmp_path / f"in{suffix}")
    np.testing.assert_allclose(xyz(records), theirs.xyz, rtol=0, atol=1e-9)
    for name in ("intensity", "red", "gps_time", "quality", "classification"):
        assert np.array_equal(records[name], np.asarray(theirs[name])), name
    move_file(tmp_path / f"in{suffix}", tmp_path / "out.ply", MOTION)
    answer = read(tmp_path / "out.ply")
    np.testing.assert_allclose(xyz(answer), moved(records), rtol=0, atol=1e-9)
    assert np.array_equal(answer["quality"], records["quality"])


@pytest.mark.parametrize("number", [0.0, float("nan"), float("inf"), 1e-300])
@pytest.mark.parametrize("axis", [0, 2])
@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_a_scale_that_makes_no_lengths_is_refused(tmp_path: Path, suffix: str, axis: int, number: float) -> None:
    """Read with it, every point has the same x, or none is finite: a cloud of nothing, and no error."""
    path = tmp_path / f"in{suffix}"
    las(path, 100)
    damaged = bytearray(path.read_bytes())
    struct.pack_into("<d", damaged, SCALES + 8 * axis, number)
    path.write_bytes(damaged)
    with pytest.raises(CloudFormatError, match="header: scales or offsets are not valid lengths: copy or write"):
        read(path)


@pytest.mark.parametrize(("source", "target"), [(".las", ".las"), (".laz", ".laz"), (".las", ".laz")])
@pytest.mark.parametrize("unit", ["m", "mm"])
def test_las_becomes_las_and_keeps_every_dimension(tmp_path: Path, source: str, target: str, unit: str) -> None:
    laspy = pytest.importorskip("laspy", reason="laspy is not installed: LAS is not tested")
    before = las(tmp_path / f"in{source}", 100_000)
    counted = move_file(tmp_path / f"in{source}", tmp_path / f"out{target}", RigidMotion.of(BASE_T_CAMERA, unit))
    after = laspy.read(str(tmp_path / f"out{target}"))
    factor = 1000 if unit == "m" else 1
    expected = before.xyz * factor @ BASE_T_CAMERA[:3, :3].T + BASE_T_CAMERA[:3, 3]
    assert counted.points == len(after.x) == 100_000
    np.testing.assert_allclose(after.xyz, expected, rtol=0, atol=0.51e-3 * factor)
    np.testing.assert_allclose(after.header.mins, after.xyz.min(axis=0), atol=1e-6)
    for name in ("intensity", "red", "gps_time", "quality", "classification"):
        assert np.array_equal(np.asarray(after[name]), np.asarray(before[name])), name


def test_las_needs_no_library_and_keeps_every_other_byte(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = las(tmp_path / "in.las", 100_000)
    with (tmp_path / "in.las").open("ab") as file:
        file.write(b"what stands behind the points")
    for name in ("laspy", "lazrs"):
        monkeypatch.setitem(sys.modules, name, None)
    assert move_file(tmp_path / "in.las", tmp_path / "out.las", MOTION).points == 100_000
    theirs, ours = ((tmp_path / name).read_bytes() for name in ("in.las", "out.las"))
    header = before.header.offset_to_point_data
    size = before.header.point_format.size
    assert len(theirs) == len(ours)
    assert ours[:SCALES] + ours[227:header] == theirs[:SCALES] + theirs[227:header]
    end = header + 100_000 * size
    assert ours[end:] == theirs[end:]
    rows = [np.frombuffer(content[header:end], np.uint8).reshape(-1, size)[:, 12:] for content in (ours, theirs)]
    assert np.array_equal(*rows)


def test_las_whose_points_leave_its_integers_is_reported(tmp_path: Path) -> None:
    las(tmp_path / "in.las", 1000)
    content = bytearray((tmp_path / "in.las").read_bytes())
    header = int.from_bytes(content[96:100], "little")
    content[header : header + 12] = 3 * (2**31 - 1).to_bytes(4, "little")
    (tmp_path / "in.las").write_bytes(content)
    for target in ("out.las", "out.laz"):
        with pytest.raises(CloudUnsupported, match=r"^in\.las: points: the moved points do not fit"):
            move_file(tmp_path / "in.las", tmp_path / target, MOTION)


def test_an_empty_las_stays_one(tmp_path: Path) -> None:
    laspy = pytest.importorskip("laspy", reason="laspy is not installed: LAS is not tested")
    laspy.create(point_format=3).write(str(tmp_path / "in.las"))
    for target in ("out.las", "out.laz"):
        assert move_file(tmp_path / "in.las", tmp_path / target, MOTION).points == 0
        assert len(laspy.read(str(tmp_path / target)).x) == 0


@settings(max_examples=cases(100), deadline=None)
@given(st.data())
def test_a_damaged_las_header_is_reported_or_moved(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    folder = tmp_path_factory.getbasetemp()
    source = folder / "sound.las"
    if not source.exists():
        las(source, 20)
    content = bytearray(source.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, 400))
        content[at : at + 1] = data.draw(st.binary(min_size=0, max_size=9))
    (folder / "damaged.las").write_bytes(content)
    with contextlib.suppress(CloudError):
        move_file(folder / "damaged.las", folder / "answer.las", MOTION, durable=False)


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_las_cut_anywhere_is_reported(tmp_path: Path, suffix: str) -> None:
    las(tmp_path / f"in{suffix}", 20)
    content = (tmp_path / f"in{suffix}").read_bytes()
    for end in range(0, len(content) - 80, 7):
        (tmp_path / f"cut{suffix}").write_bytes(content[:end])
        with pytest.raises(CloudError, match=f"^cut{suffix}: "):
            read(tmp_path / f"cut{suffix}")
        with pytest.raises(CloudError, match=f"^cut{suffix}: "):
            move_file(tmp_path / f"cut{suffix}", tmp_path / f"out{suffix}", MOTION)
    assert not list(tmp_path.glob("*out*"))


def test_e57_is_read_in_blocks(tmp_path: Path) -> None:
    pye57 = pytest.importorskip("pye57", reason="pye57 is not installed: E57 is not tested")
    records = cloud(XYZ_FLOAT32, 100_000)
    points = {f"cartesian{axis}": records[axis.lower()].astype(float) for axis in "XYZ"}
    points["intensity"] = np.arange(100_000) / 100_000
    file = pye57.E57(str(tmp_path / "in.e57"), mode="w")
    file.write_scan_raw(points)
    file.close()
    again = read(tmp_path / "in.e57")
    assert np.array_equal(xyz(again), xyz(records))
    np.testing.assert_allclose(again["intensity"], points["intensity"], atol=1e-6)
    content = (tmp_path / "in.e57").read_bytes()
    for end in (0, 20, 48, 1000, len(content) // 2, len(content) - 1):
        (tmp_path / "cut.e57").write_bytes(content[:end])
        with pytest.raises(CloudError, match=r"^cut\.e57: "):
            read(tmp_path / "cut.e57")


def test_several_scans_of_an_e57_are_read_one_after_the_other_and_moved(tmp_path: Path) -> None:
    pye57 = pytest.importorskip("pye57", reason="pye57 is not installed: E57 is not tested")
    scans = [cloud(XYZ_FLOAT32, count) for count in (20_000, 5, 17_000)]
    file = pye57.E57(str(tmp_path / "in.e57"), mode="w")
    for scan in scans:
        file.write_scan_raw({f"cartesian{axis}": scan[axis.lower()].astype(float) for axis in "XYZ"})
    file.close()
    records = read(tmp_path / "in.e57")
    assert np.array_equal(xyz(records), np.concatenate([xyz(scan) for scan in scans]))
    assert move_file(tmp_path / "in.e57", tmp_path / "out.e57", MOTION).points == len(records)
    np.testing.assert_allclose(1000 * xyz(read(tmp_path / "out.e57")), moved(records), rtol=0, atol=1e-3)  # E57 is in m


def test_an_e57_without_points_is_read(tmp_path: Path) -> None:
    pytest.importorskip("pye57", reason="pye57 is not installed: E57 is not tested")
    with new_cloud(tmp_path / "empty.e57", XYZ_FLOAT32):
        pass
    with open_cloud(tmp_path / "empty.e57") as source:
        assert (source.count, list(source.blocks())) == (0, [])


@pytest.mark.parametrize("suffix", [".las", ".laz", ".e57"])
def test_a_ply_becomes_what_the_libraries_read(tmp_path: Path, suffix: str) -> None:
    pytest.importorskip({".e57": "pye57"}.get(suffix, "lazrs"), reason="its library is not installed: not tested")
    records = cloud(RICH, 150_000)
    with new_cloud(tmp_path / "in.ply", RICH) as writer:
        writer.write(records)
    assert move_file(tmp_path / "in.ply", tmp_path / f"out{suffix}", MOTION).points == len(records)
    answer = read(tmp_path / f"out{suffix}")
    unit_mm = 1000 if suffix == ".e57" else 1  # the standard says metres
    np.testing.assert_allclose(xyz(answer) * unit_mm, moved(records), rtol=0, atol=3e-3)
    assert np.array_equal(answer["intensity"], records["intensity"])
    factor = 1 if suffix == ".e57" else 257
    for name in ("red", "green", "blue"):
        assert np.array_equal(answer[name], records[name] * np.uint16(factor)), name
    if suffix != ".e57":
        assert np.array_equal(answer["time"], records["time"])
    assert sorted(file.name for file in tmp_path.iterdir()) == ["in.ply", f"out{suffix}"]


@pytest.mark.parametrize("suffix", [".laz", ".e57"])
def test_a_point_that_is_nowhere_leaves_no_file_of_a_format_that_cannot_hold_it(tmp_path: Path, suffix: str) -> None:
    pytest.importorskip({".e57": "pye57"}.get(suffix, "lazrs"), reason="its library is not installed: not tested")
    (tmp_path / "in.csv").write_text("1 2 3\n4 nan 6\n")
    with pytest.raises(CloudUnsupported, match=rf"^out\{suffix}: points: "):
        move_file(tmp_path / "in.csv", tmp_path / f"out{suffix}", MOTION)
    assert [file.name for file in tmp_path.iterdir()] == ["in.csv"]


def test_an_extra_that_is_not_installed_is_named() -> None:
    with pytest.raises(
        CloudUnsupported, match=r"cloud\.las: format: no_such_library is not installed: install handeyed"
    ):
        extras.library("no_such_library", "las", "cloud.las")
