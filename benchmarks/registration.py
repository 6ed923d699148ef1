"""Registration beside its physical limits and its peers, as ratios of one run: `python -m benchmarks.registration`.

Peers are compared where they are installed. Peak memory is measured in a process of its own.
"""

import argparse
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.registration_door import door
from calibration.transforms import rotation_from_vector, transform
from registration.files import move_file
from registration.formats import pcd, ply
from registration.layout import XYZ_FLOAT32, Layout
from registration.motion import Motion, move_points
from registration.overlap import agreement
from registration.reading import open_cloud
from registration.refine.adjust import refine_poses
from registration.scan import Hand, read_scan, register_views, sample_views
from registration.sphere import find_artefact
from registration.sphere_calibration import SphereView, solve_from_sphere
from registration.stream import CloudStream
from registration.voxel import VoxelGrid

BASE_T_CAMERA = transform(rotation_from_vector([0.1, 0.5, -0.3]), [100.0, -200.0, 300.0])
MOTION = Motion.of(BASE_T_CAMERA, "mm")
COLOURED = Layout.of(
    np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), *((c, "u1") for c in ("red", "green", "blue"))])
)
PADDED = Layout.of(np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("_3", "u1", (4,))]))

MEMORY_PROBE = """
import sys
from pathlib import Path
import numpy as np
from registration.files import move_file
from registration.motion import Motion
if sys.argv[1]:
    move_file(Path(sys.argv[1]), Path(sys.argv[2]), Motion.of(np.eye(4), "mm"))
peak = Path('/proc/self/status').read_text().split('VmHWM:')[1].split()[0]
print(int(peak) // 1024)
"""


def open3d_here() -> Any:
    """Open3D, or None: installed it may still miss the system's libusb or libGL."""
    try:
        return import_module("open3d")
    except (ImportError, OSError):
        return None


def best(work: Callable[[], object], repeat: int = 7) -> float:
    """The fastest of some runs, in seconds."""
    times = []
    for _ in range(repeat):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return min(times)


def ratio(limit: Callable[[], object], work: Callable[[], object], repeat: int = 9) -> float:
    """How fast `work` is beside `limit`: the median of ratios of neighbouring runs, so that the load cancels."""
    return float(np.median([best(limit, 1) / best(work, 1) for _ in range(repeat)]))


@dataclass(frozen=True)
class Cost:
    """Of one run: seconds on the clock, and seconds of all processors (children too), which other programs hardly
    change."""

    wall_s: float
    cpu_s: float


def cost(work: Callable[[], object]) -> Cost:
    began, before = time.perf_counter(), _cpu_s()
    work()
    return Cost(time.perf_counter() - began, _cpu_s() - before)


def _cpu_s() -> float:
    own, children = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return own.ru_utime + own.ru_stime + children.ru_utime + children.ru_stime


def beside(what: str, limit: Callable[[], object], work: Callable[[], object], of: str, repeat: int = 15) -> None:
    """A row: best against best of interleaved runs on the clock; the median of the pairs; the least processor time."""
    pairs = [(cost(limit), cost(work)) for _ in range(repeat)]
    limits, works = zip(*pairs, strict=True)
    fastest = min(each.wall_s for each in limits) / min(each.wall_s for each in works)
    middle = float(np.median([a.wall_s / b.wall_s for a, b in pairs]))
    processor = min(each.cpu_s for each in limits) / max(0.001, min(each.cpu_s for each in works))
    row(what, fastest, of, f"median of pairs {middle:.2f}, by processor time {processor:.2f}")


def row(what: str, ratio: float, of: str, note: str = "") -> None:
    print(f"{what:<46}{ratio:8.2f} x {of:<19}{note}", flush=True)


def kernel(points: int) -> None:
    source = np.random.default_rng(0).normal(0, 100, (points, 3)).astype(np.float32)
    target = np.zeros_like(source)

    def copy() -> None:
        np.copyto(target, source)

    row(
        f"kernel, {points:.0e} float32 points",
        ratio(copy, lambda: move_points(MOTION.matrix, source, target), 15),
        "memcpy",
    )
    rotation = MOTION.rotation.T.astype(np.float32)
    row("  numpy P @ R.T + t", ratio(copy, lambda: source @ rotation + np.float32(1), 3), "memcpy")
    if find_spec("trimesh"):
        import trimesh

        row(
            "  trimesh.transform_points",
            ratio(copy, lambda: trimesh.transform_points(source, BASE_T_CAMERA), 2),
            "memcpy",
        )


def files(points: int, folder: Path) -> None:
    for name, layout, suffix in (
        ("PLY xyz", XYZ_FLOAT32, ".ply"),
        ("PLY with colour", COLOURED, ".ply"),
        ("PCD with padding", PADDED, ".pcd"),
    ):
        source, target = folder / f"in{suffix}", folder / f"out{suffix}"
        write(source, layout, points)

        copy, ours = copying(source, target), moving(source, target)
        beside(f"{name}, file to file", copy, ours, "cp")
        beside(
            "  both synced to the disk", copying(source, target, True), moving(source, target, True), "cp and sync", 5
        )
        print(f"  peak memory {memory(source, target)} MB, {memory(None, target)} MB of it imports", flush=True)
        if suffix == ".ply":
            peers(source, target, copy, ours)


def copying(source: Path, target: Path, synced: bool = False) -> Callable[[], object]:
    """What `cp` does when it may not share the blocks (--reflink=never), over the file of the run before."""

    def copy() -> None:
        subprocess.run(["cp", "--reflink=never", source, target], check=True)
        if synced:
            subprocess.run(["sync", target], check=True)

    return copy


def moving(source: Path, target: Path, synced: bool = False) -> Callable[[], object]:
    return lambda: move_file(source, target, MOTION, durable=synced)


def write(path: Path, layout: Layout, points: int) -> None:
    header = ply.format_header if path.suffix == ".ply" else pcd.format_header
    records = np.zeros(points, layout.dtype)
    for axis, name in enumerate("xyz"):
        records[name] = np.random.default_rng(axis).normal(0, 100, points)
    with path.open("wb") as file:
        file.write(header(layout, points))
        records.tofile(file)


def las(points: int, folder: Path) -> None:
    """LAS and LAZ beside a copy and beside laspy's own reading and writing."""
    if not find_spec("laspy"):
        return
    import laspy

    content = laspy.create(point_format=3)
    content.header.scales = [0.001] * 3
    content.x, content.y, content.z = np.random.default_rng(0).normal(0, 100, (3, points))
    for suffix in (".las", ".laz") if find_spec("lazrs") else (".las",):
        source, target = folder / f"in{suffix}", folder / f"out{suffix}"
        content.write(str(source))

        def theirs(source: Path = source, target: Path = target) -> None:
            laspy.read(str(source)).write(str(target))

        ours = moving(source, target)
        beside(f"{suffix[1:].upper()}, file to file", copying(source, target), ours, "cp", 9)
        beside("  ours", theirs, ours, "laspy", 3)
        print(f"  peak memory {memory(source, target)} MB, {memory(None, target)} MB of it imports", flush=True)


def memory(source: Path | None, target: Path) -> int:
    """Peak resident memory of a process that moves one file, in MB."""
    arguments = [sys.executable, "-c", MEMORY_PROBE, str(source or ""), str(target)]
    return int(subprocess.run(arguments, check=True, capture_output=True, text=True).stdout)


def peers(source: Path, target: Path, copy: Callable[[], object], ours: Callable[[], object]) -> None:
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

        row("  plyfile", ratio(copy, through_plyfile, 2), "cp")
    if (open3d := open3d_here()) is not None:

        def through_open3d() -> None:
            cloud = open3d.t.io.read_point_cloud(str(source))
            open3d.t.io.write_point_cloud(str(target), cloud.transform(BASE_T_CAMERA))

        row("  Open3D, tensor API", ratio(copy, through_open3d, 2), "cp")
        beside("  ours", through_open3d, ours, "Open3D, tensor API", 3)


def stream(points: int) -> None:
    """Bytes in, bytes out, as the daemon feeds it from the socket."""
    body = np.random.default_rng(0).normal(0, 100, 3 * points).astype(np.float32).tobytes()
    chunk = 1 << 16

    def ours() -> None:
        moved = CloudStream("application/octet-stream", BASE_T_CAMERA, "mm")
        for start in range(0, len(body), chunk):
            moved.feed(body[start : start + chunk])
        moved.finish()

    print(f"{'stream, 64 kB pieces':<46}{len(body) / best(ours) / 1e9:8.2f} GB a second")


def voxels(points: int, edge_mm: float) -> None:
    records = np.zeros(points, XYZ_FLOAT32.dtype)
    for axis, name in enumerate("xyz"):
        records[name] = np.random.default_rng(axis).uniform(0, 500, points)

    def ours() -> None:
        grid = VoxelGrid(edge_mm, XYZ_FLOAT32)
        for start in range(0, points, 1 << 16):
            grid.add(records[start : start + (1 << 16)])
        list(grid.blocks())

    print(f"{f'voxel grid, {points:.0e} points':<46}{points / best(ours, 2) / 1e6:8.2f} million points a second")
    cloud = np.stack([records[name] for name in "xyz"], axis=1).astype(float)
    if find_spec("small_gicp"):
        import small_gicp

        beside("  ours", lambda: small_gicp.voxelgrid_sampling(cloud, edge_mm), ours, "small_gicp", 3)
    if (open3d := open3d_here()) is not None:
        legacy = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(cloud))
        beside("  ours", lambda: legacy.voxel_down_sample(edge_mm), ours, "Open3D, legacy", 3)


def compressed(points: int, folder: Path) -> None:
    """PCD binary_compressed, written by Open3D, read by us and by it."""
    if (open3d := open3d_here()) is None:
        return
    cloud = open3d.geometry.PointCloud(
        open3d.utility.Vector3dVector(np.random.default_rng(0).normal(0, 9, (points, 3)))
    )
    file = folder / "compressed.pcd"
    open3d.io.write_point_cloud(str(file), cloud, compressed=True)

    def ours() -> None:
        with open_cloud(file) as source:
            for _ in source.blocks():
                pass

    print(f"{'PCD compressed (LZF), read':<46}{file.stat().st_size / best(ours, 2) / 1e6:8.2f} MB a second")
    beside("  ours", lambda: open3d.io.read_point_cloud(str(file)), ours, "Open3D", 2)


def e57(points: int, folder: Path) -> None:
    """E57 read in blocks, beside pye57's own reading of everything at once."""
    if not find_spec("pye57"):
        return
    import pye57

    file = folder / "cloud.e57"
    writer = pye57.E57(str(file), mode="w")
    writer.write_scan_raw({f"cartesian{axis}": np.random.default_rng(0).normal(0, 9, points) for axis in "XYZ"})
    writer.close()

    def ours() -> None:
        with open_cloud(file) as source:
            for _ in source.blocks():
                pass

    def theirs() -> None:
        pye57.E57(str(file)).read_scan_raw(0)

    beside(f"E57, {points:.0e} points, read", theirs, ours, "pye57", 5)


def real(data: Path) -> None:
    """Nine views of real objects, X from the sphere."""
    spheres = read_scan(data / "reghec_sphere")
    fits = [find_artefact(sample.surface.points, 48.37) for sample in sample_views(spheres)]
    x = solve_from_sphere([SphereView(fit.centre, view.base_T_flange) for fit, view in zip(fits, spheres, strict=True)])
    spread, left_out = x.spread_mm.round(3).tolist(), x.left_out_mm
    print(f"sphere centre over 9 views, plain formula: {spread} mm; left out: {np.round(left_out, 2)} mm")
    hand = Hand("sphere", x.flange_T_camera)
    for folder in sorted(data.glob("reghec_*")):
        views = read_scan(folder)
        samples = sample_views(views)
        began = time.perf_counter()
        found = register_views(views, samples, hand, refine=True)
        spent = time.perf_counter() - began
        after = found.after.rms_mm if found.after else None
        print(
            f"{folder.name:<20} before {found.before.rms_mm:.3f} mm, refined {after:.3f} mm, {spent:.1f} s", flush=True
        )
        if folder.name == "reghec_david" and find_spec("small_gicp"):
            pairs_of_small_gicp(folder, hand, spent)


def pairs_of_small_gicp(folder: Path, hand: Hand, spent: float) -> None:
    """The same 36 pairs, aligned one by one."""
    import small_gicp

    views = read_scan(folder)
    samples = sample_views(views)
    poses = [view.base_T_flange @ hand.flange_T_camera for view in views]
    began = time.perf_counter()
    clouds = [small_gicp.preprocess_points(sample.surface.points, downsampling_resolution=0.7) for sample in samples]
    for one in range(len(views)):
        for two in range(one):
            start = np.linalg.inv(poses[one]) @ poses[two]
            small_gicp.align(clouds[one][0], clouds[two][0], clouds[one][1], init_T_target_source=start)
    row("  small_gicp, the same pairs", spent / (time.perf_counter() - began), "its time, ours")
    surfaces = [sample.surface for sample in samples]
    alone = best(lambda: refine_poses(surfaces, poses, [view.base_T_flange for view in views]), 1)
    look = best(lambda: agreement(surfaces, poses), 1)
    print(f"  of it the refinement {alone:.1f} s, one look at all pairs {look:.2f} s")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=10_000_000)
    parser.add_argument("--data", type=Path, default=Path(__file__).resolve().parents[2] / "shared" / "data")
    options = parser.parse_args()
    kernel(options.points)
    folder = Path(tempfile.mkdtemp(prefix="handeyed-bench-"))
    try:
        files(options.points, folder)
        las(options.points // 5, folder)
        e57(options.points // 10, folder)
        compressed(options.points // 20, folder)
    finally:
        shutil.rmtree(folder)
    stream(options.points)
    voxels(options.points, 10.0)
    voxels(options.points, 3.0)
    door()
    if options.data.is_dir():
        real(options.data)
    else:
        print(f"no real data at {options.data}")


if __name__ == "__main__":
    main()
