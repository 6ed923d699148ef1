"""Clouds from file to file, compared with a copy of the same bytes and with libraries that read and write them."""

import os
import shutil
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from benchmarks.registration.rows import Work, beside, heading, note, open3d_here
from calibration.transforms import rotation_from_vector, transform
from registration.io.convert import move_file
from registration.io.formats import pcd, ply
from registration.io.reading import open_cloud
from registration.points.layout import XYZ_FLOAT32, Layout
from registration.points.rigid_motion import RigidMotion

BASE_T_CAMERA = transform(rotation_from_vector([0.1, 0.5, -0.3]), [100.0, -200.0, 300.0])
MOTION = RigidMotion.of(BASE_T_CAMERA, "mm")
COLOURED = Layout.of(
    np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), *((c, "u1") for c in ("red", "green", "blue"))])
)
PADDED = Layout.of(np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("_3", "u1", (4,))]))
CLOUDS = (("PLY xyz", XYZ_FLOAT32, ".ply"), ("PLY with colour", COLOURED, ".ply"), ("PCD with padding", PADDED, ".pcd"))
MEMORY = Path("/dev/shm")

MEMORY_PROBE = """
import sys
from pathlib import Path
import numpy as np
from registration.io.convert import move_file
from registration.points.rigid_motion import RigidMotion
if sys.argv[1]:
    move_file(Path(sys.argv[1]), Path(sys.argv[2]), RigidMotion.of(np.eye(4), "mm"))
peak = Path('/proc/self/status').read_text().split('VmHWM:')[1].split()[0]
print(int(peak) // 1024)
"""


def files(points: int) -> None:
    """On the disk, and in memory, without the disk's variations."""
    for place, folder in (("on disk", None), ("in /dev/shm", MEMORY)):
        if folder is not None and not folder.is_dir():
            continue
        inside = Path(tempfile.mkdtemp(prefix="handeyed-bench-", dir=folder))
        try:
            heading(f"file to file, {points:.0e} points, {place}")
            for name, layout, suffix in CLOUDS:
                _cloud(name, layout, inside / f"in{suffix}", points, peers=folder is None)
            las(points // 5, inside, peers=folder is None)
            if folder is None:
                e57(points // 10, inside)
                read_compressed_pcd(points // 20, inside)
        finally:
            shutil.rmtree(inside)


def _cloud(name: str, layout: Layout, source: Path, points: int, peers: bool) -> None:
    target = source.with_stem("out")
    write(source, layout, points)
    beside(name, copying(source, target), moving(source, target), "cp", before=lambda: fresh(target))
    if peers:
        what = f"{name}, both synced"
        beside(
            what, copying(source, target, True), moving(source, target, True), "cp and sync", 5, lambda: fresh(target)
        )
        note(f"peak memory {memory(source, target)} MB, {memory(None, target)} MB of it imports")
        if source.suffix == ".ply":
            _ply_peers(source, target)
    source.unlink()
    target.unlink()


def fresh(target: Path) -> None:
    """Remove the old target, and flush earlier writes."""
    target.unlink(missing_ok=True)
    os.sync()


def copying(source: Path, target: Path, synced: bool = False) -> Work:
    """Copy as `cp` does when it may not share blocks (--reflink=never)."""

    def copy() -> None:
        subprocess.run(["cp", "--reflink=never", source, target], check=True)
        if synced:
            subprocess.run(["sync", target], check=True)

    return copy


def moving(source: Path, target: Path, synced: bool = False) -> Work:
    return lambda: move_file(source, target, MOTION, durable=synced)


def write(path: Path, layout: Layout, points: int) -> None:
    header = ply.format_header if path.suffix == ".ply" else pcd.format_header
    records = np.zeros(points, layout.dtype)
    for axis, name in enumerate("xyz"):
        records[name] = np.random.default_rng(axis).normal(0, 100, points)
    with path.open("wb") as file:
        file.write(header(layout, points))
        records.tofile(file)


def memory(source: Path | None, target: Path) -> int:
    """Peak resident memory in MB of a process that moves one file."""
    arguments = [sys.executable, "-c", MEMORY_PROBE, str(source or ""), str(target)]
    return int(subprocess.run(arguments, check=True, capture_output=True, text=True).stdout)


def las(points: int, folder: Path, peers: bool) -> None:
    """LAS and LAZ against a copy and against laspy's reading and writing."""
    if not find_spec("laspy"):
        return
    import laspy

    content = laspy.create(point_format=3)
    content.header.scales = [0.001] * 3
    content.x, content.y, content.z = np.random.default_rng(0).normal(0, 100, (3, points))
    for suffix in (".las", ".laz") if find_spec("lazrs") and peers else (".las",):
        source, target = folder / f"in{suffix}", folder / f"out{suffix}"
        content.write(str(source))
        name, ours = f"{suffix[1:].upper()}, {points:.0e} points", moving(source, target)

        def theirs(source: Path = source, target: Path = target) -> None:
            laspy.read(str(source)).write(str(target))

        def move_by_laspy(source: Path = source, target: Path = target) -> None:
            cloud = laspy.read(str(source))
            points = cloud.xyz @ MOTION.rotation.T + MOTION.matrix[:, 3]
            cloud.change_scaling(scales=[0.001] * 3, offsets=np.rint(points.mean(axis=0)))
            cloud.x, cloud.y, cloud.z = points.T
            cloud.write(str(target))

        if suffix == ".las":
            beside(name, copying(source, target), ours, "cp", before=lambda: fresh(target))  # noqa: B023 - called now
        if peers:
            beside(name, theirs, ours, "laspy reading and writing", 5, before=lambda: fresh(target))  # noqa: B023
            beside(name, move_by_laspy, ours, "laspy, moving too", 3, before=lambda: fresh(target))  # noqa: B023
            note(f"peak memory {memory(source, target)} MB, {memory(None, target)} MB of it imports")


def _ply_peers(source: Path, target: Path) -> None:
    ours, name, before = moving(source, target), "  ours", lambda: fresh(target)
    if find_spec("plyfile"):
        import plyfile

        def through_plyfile() -> None:
            data = plyfile.PlyData.read(source)
            vertex = data["vertex"].data
            points = np.stack([vertex[name] for name in "xyz"], axis=1) @ MOTION.rotation.T + MOTION.matrix[:, 3]
            vertex = vertex.copy()
            for axis, name in enumerate("xyz"):
                vertex[name] = points[:, axis]
            plyfile.PlyData([plyfile.PlyElement.describe(vertex, "vertex")]).write(target)

        beside(name, through_plyfile, ours, "plyfile", 3, before)
    if (open3d := open3d_here()) is not None:

        def through_open3d() -> None:
            cloud = open3d.t.io.read_point_cloud(str(source))
            open3d.t.io.write_point_cloud(str(target), cloud.transform(BASE_T_CAMERA))

        beside(name, through_open3d, ours, "Open3D, tensor API", 9, before)
    if find_spec("trimesh"):
        import trimesh

        def through_trimesh() -> None:
            cloud = trimesh.load(source)
            cloud.apply_transform(BASE_T_CAMERA)
            cloud.export(target)

        beside(name, through_trimesh, ours, "trimesh", 1, before)


def read_compressed_pcd(points: int, folder: Path) -> None:
    """PCD binary_compressed, written by Open3D, read by handeyed and by Open3D."""
    if (open3d := open3d_here()) is None:
        return
    cloud = open3d.geometry.PointCloud(
        open3d.utility.Vector3dVector(np.random.default_rng(0).normal(0, 9, (points, 3)))
    )
    file = folder / "compressed.pcd"
    open3d.io.write_point_cloud(str(file), cloud, compressed=True)
    name = f"PCD compressed, {points:.0e} points, read"
    beside(name, lambda: open3d.io.read_point_cloud(str(file)), lambda: _read(file), "Open3D", 3)
    note(f"peak memory {memory(file, folder / 'out.pcd')} MB, {memory(None, file)} MB of it imports")


def e57(points: int, folder: Path) -> None:
    """E57 read in blocks, against pye57's reading of everything at once."""
    if not find_spec("pye57"):
        return
    import pye57

    file = folder / "cloud.e57"
    writer = pye57.E57(str(file), mode="w")
    writer.write_scan_raw({f"cartesian{axis}": np.random.default_rng(0).normal(0, 9, points) for axis in "XYZ"})
    writer.close()
    theirs = lambda: pye57.E57(str(file)).read_scan_raw(0)  # noqa: E731
    beside(f"E57, {points:.0e} points, read", theirs, lambda: _read(file), "pye57", 5)


def _read(file: Path) -> None:
    with open_cloud(file) as source:
        for _ in source.blocks():
            pass
