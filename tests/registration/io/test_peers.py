"""Programs that nobody here wrote read what is written, and what they write is read.

plyfile, laspy and lazrs (`test_extras.py`) are installed with the development tools; Open3D, pye57 and Debian's
pcl-tools are asked where they are installed.
"""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from registration.io.convert import move_file
from registration.points.layout import Records
from registration.points.rigid_motion import RigidMotion
from tests.registration.clouds import BASE_T_CAMERA, RICH, cloud, moved, xyz
from tests.registration.io.cloud_files import read, write
from tests.support.cases import with_library, with_program

MOTION = RigidMotion.of(BASE_T_CAMERA, "mm")


def colours(records: Records) -> NDArray[np.float64]:
    """(n, 3), 0 to 1."""
    return xyz(records, ("red", "green", "blue")) / 255


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize(
    ("suffix", "further"),
    with_library(
        "open3d",
        [
            (".ply", {}),
            (".ply", {"write_ascii": True}),
            (".pcd", {}),
            (".pcd", {"compressed": True}),
            (".pcd", {"write_ascii": True}),
        ],
    ),
)
def test_open3d_reads_ours_and_we_read_its(tmp_path: Path, suffix: str, further: dict[str, bool]) -> None:
    open3d = pytest.importorskip(
        "open3d", reason="Open3D is not installed: its files are not compared", exc_type=ImportError
    )
    records = cloud(RICH, 3000)
    theirs = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(xyz(records)))
    theirs.normals = open3d.utility.Vector3dVector(xyz(records, ("nx", "ny", "nz")))
    theirs.colors = open3d.utility.Vector3dVector(colours(records))
    assert open3d.io.write_point_cloud(str(tmp_path / f"theirs{suffix}"), theirs, **further)
    np.testing.assert_allclose(xyz(read(tmp_path / f"theirs{suffix}")), xyz(records), rtol=0, atol=1e-3)
    move_file(tmp_path / f"theirs{suffix}", tmp_path / f"ours{suffix}", MOTION)
    again = open3d.io.read_point_cloud(str(tmp_path / f"ours{suffix}"))
    np.testing.assert_allclose(np.asarray(again.points), moved(records), rtol=0, atol=5e-3)
    turned = xyz(records, ("nx", "ny", "nz")) @ BASE_T_CAMERA[:3, :3].T
    np.testing.assert_allclose(np.asarray(again.normals), turned, rtol=0, atol=1e-4)
    np.testing.assert_allclose(np.asarray(again.colors), colours(records), rtol=0, atol=1e-6)


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("target", with_library("open3d", [".ply", ".pcd"]))
@pytest.mark.parametrize("source", with_library("open3d", [".ply", ".pcd", ".npy", ".csv"]))
def test_open3d_finds_colours_and_normals_in_a_cloud_that_was_another(tmp_path: Path, source: str, target: str) -> None:
    open3d = pytest.importorskip(
        "open3d", reason="Open3D is not installed: its files are not compared", exc_type=ImportError
    )
    records = cloud(RICH, 300)
    write(tmp_path / f"in{source}", RICH, records)
    move_file(tmp_path / f"in{source}", tmp_path / f"ours{target}", MOTION)
    again = open3d.io.read_point_cloud(str(tmp_path / f"ours{target}"))
    np.testing.assert_allclose(np.asarray(again.points), moved(records), rtol=0, atol=5e-3)
    turned = xyz(records, ("nx", "ny", "nz")) @ BASE_T_CAMERA[:3, :3].T
    np.testing.assert_allclose(np.asarray(again.normals), turned, rtol=0, atol=1e-4)
    if (source, target) != (".csv", ".pcd"):  # numbers of a text may be no bytes, and stay numbers there
        np.testing.assert_allclose(np.asarray(again.colors), colours(records), rtol=0, atol=1e-6)


def test_plyfile_reads_ours_and_we_read_its(tmp_path: Path) -> None:
    plyfile = pytest.importorskip("plyfile", reason="plyfile is not installed: its files are not compared")
    records = cloud(RICH, 300)
    write(tmp_path / "ours.ply", RICH, records)
    theirs = plyfile.PlyData.read(tmp_path / "ours.ply")["vertex"].data
    for name in records.dtype.names or ():
        assert np.array_equal(theirs[name], records[name])
    faces = np.array([([0, 1, 2],), ([1, 2, 3],)], dtype=[("vertex_indices", "i4", (3,))])
    elements = [plyfile.PlyElement.describe(records, "vertex"), plyfile.PlyElement.describe(faces, "face")]
    for text, order in ((False, "<"), (False, ">"), (True, "=")):
        plyfile.PlyData(elements, text=text, byte_order=order).write(tmp_path / "theirs.ply")
        again = read(tmp_path / "theirs.ply")
        for name in records.dtype.names or ():
            np.testing.assert_allclose(again[name], records[name], rtol=1e-6)
        move_file(tmp_path / "theirs.ply", tmp_path / "moved.ply", MOTION)
        moved_by_us = plyfile.PlyData.read(tmp_path / "moved.ply")
        assert [face.tolist() for face in moved_by_us["face"]["vertex_indices"]] == [[0, 1, 2], [1, 2, 3]]
        np.testing.assert_allclose(xyz(moved_by_us["vertex"].data), moved(records), rtol=0, atol=2e-3)


def pcl(tool: str, *arguments: object) -> None:
    program = shutil.which(tool)
    if program is None:
        pytest.skip(f"{tool} is not installed (Debian's pcl-tools): its files are not compared")
    subprocess.run([program, *map(str, arguments)], check=True, capture_output=True)


ASCII, BINARY, COMPRESSED = 0, 1, 2


@pytest.mark.parametrize("form", with_program("pcl_convert_pcd_ascii_binary", [ASCII, BINARY, COMPRESSED]))
def test_pcl_reads_ours_and_we_read_its(tmp_path: Path, form: int) -> None:
    records = cloud(RICH, 3000)
    write(tmp_path / "ours.pcd", RICH, records)
    pcl("pcl_convert_pcd_ascii_binary", tmp_path / "ours.pcd", tmp_path / "theirs.pcd", form)
    again = read(tmp_path / "theirs.pcd", common=True)
    tolerance = {"rtol": 1e-5, "atol": 1e-5} if form == ASCII else {"rtol": 0, "atol": 0}
    for name in records.dtype.names or ():
        np.testing.assert_allclose(again[name], records[name], **tolerance, err_msg=name)
    move_file(tmp_path / "theirs.pcd", tmp_path / "moved.pcd", MOTION)
    pcl("pcl_convert_pcd_ascii_binary", tmp_path / "moved.pcd", tmp_path / "again.pcd", BINARY)
    np.testing.assert_allclose(xyz(read(tmp_path / "again.pcd")), moved(records), rtol=0, atol=5e-2)


def test_pcl_finds_colours_and_normals(tmp_path: Path) -> None:
    """Its programs keep fields they do not know; this one makes records of its own types and back."""
    records = cloud(RICH, 300)
    write(tmp_path / "ours.pcd", RICH, records)
    pcl("pcl_pcd2ply", tmp_path / "ours.pcd", tmp_path / "theirs.ply")
    again = read(tmp_path / "theirs.ply", common=True)
    for name in ("x", "y", "z", "red", "green", "blue"):
        np.testing.assert_array_equal(again[name], records[name], err_msg=name)
