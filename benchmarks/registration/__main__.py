"""Registration compared with physical limits and other software, as ratios: `python -m benchmarks.registration`.

Other software is compared where installed. Peak memory is measured in a process of its own.
"""

import argparse
import time
from collections.abc import Callable
from importlib.util import find_spec
from itertools import combinations
from pathlib import Path

import numpy as np

from benchmarks.registration.door import door
from benchmarks.registration.files import BASE_T_CAMERA, MOTION, files
from benchmarks.registration.rows import beside, best, heading, note, open3d_here
from calibration.solution import Solution
from calibration.transforms import difference
from registration.calibrate.outcome import judge_scan
from registration.calibrate.sphere import solve_sphere_scan
from registration.calibrate.sphere_solver import solve_from_sphere
from registration.calibrate.surfaces import solve_surface_scan
from registration.fusion.overlap import agreement
from registration.fusion.pose_adjustment import refine_poses
from registration.io.stream import CloudStream
from registration.points.layout import XYZ_FLOAT32
from registration.points.rigid_motion import move_points
from registration.points.sphere_fit import find_artefact
from registration.points.surface import Surface
from registration.points.voxel_grid import VoxelGrid
from registration.scan import ScannerMount, register_views, sample_views
from registration.scan_folder import read_scan


def kernel(points: int) -> None:
    source = np.random.default_rng(0).normal(0, 100, (points, 3)).astype(np.float32)
    target = np.zeros_like(source)
    rotation = MOTION.rotation.T.astype(np.float32)

    def copy() -> None:
        np.copyto(target, source)

    heading(f"in memory, {points:.0e} float32 points")
    beside("kernel", copy, lambda: move_points(MOTION.matrix, source, target), "memcpy")
    beside("  numpy P @ R.T + t", copy, lambda: source @ rotation + np.float32(1), "memcpy", 3)
    if find_spec("trimesh"):
        import trimesh

        beside("  trimesh", copy, lambda: trimesh.transform_points(source, BASE_T_CAMERA), "memcpy", 2)
    if (open3d := open3d_here()) is not None:
        cloud = open3d.t.geometry.PointCloud(open3d.core.Tensor(source))
        beside("  Open3D, tensor API", copy, lambda: cloud.transform(BASE_T_CAMERA), "memcpy", 3)


def stream(points: int) -> None:
    """Bytes in, bytes out, as the daemon feeds it from the socket."""
    body = np.random.default_rng(0).normal(0, 100, 3 * points).astype(np.float32).tobytes()
    chunk = 1 << 16

    def ours() -> None:
        moved = CloudStream.of_body("application/octet-stream", BASE_T_CAMERA, "mm")
        for start in range(0, len(body), chunk):
            list(moved.parts(body[start : start + chunk]))
        list(moved.last_parts())

    note(f"as a stream in pieces of 64 kB: {len(body) / best(ours) / 1e9:.2f} GB a second")


def voxels(points: int, edge_mm: float) -> None:
    records = np.zeros(points, XYZ_FLOAT32.dtype)
    for axis, name in enumerate("xyz"):
        records[name] = np.random.default_rng(axis).uniform(0, 500, points)

    def ours() -> None:
        grid = VoxelGrid(edge_mm, XYZ_FLOAT32)
        for start in range(0, points, 1 << 16):
            grid.add(records[start : start + (1 << 16)])
        list(grid.blocks())

    heading(f"voxel grid of {edge_mm:g} mm, {points:.0e} points")
    cloud = np.stack([records[name] for name in "xyz"], axis=1).astype(float)
    if (open3d := open3d_here()) is not None:
        legacy = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(cloud))
        beside("ours", lambda: legacy.voxel_down_sample(edge_mm), ours, "Open3D, legacy", 2)
    if find_spec("small_gicp"):
        import small_gicp

        beside("ours", lambda: small_gicp.voxelgrid_sampling(cloud, edge_mm), ours, "small_gicp", 2)
    if find_spec("kiss_icp"):
        from kiss_icp.voxelization import voxel_down_sample

        beside("ours", lambda: voxel_down_sample(cloud, edge_mm), ours, "kiss-icp, which averages nothing", 1)
    note(f"{points / best(ours, 2) / 1e6:.2f} million points a second")


def real(data: Path) -> None:
    """Nine views of real objects, X from the sphere."""
    spheres = read_scan(data / "reghec_sphere")
    fits = [find_artefact(sample.surface.points, 48.37) for sample in sample_views(spheres)]
    centres_mm, base_T_flange = [fit.centre for fit in fits], [view.base_T_flange for view in spheres]
    x = solve_from_sphere(np.array(centres_mm), np.array(base_T_flange))
    spread, left_out = x.spread_mm.round(3).tolist(), x.left_out_mm
    print(f"\nsphere centre over 9 views, plain formula: {spread} mm; left out: {np.round(left_out, 2)} mm")
    hand = ScannerMount("sphere", x.mount_T_camera)
    print(f"\n{'nine views of a real object, X from the sphere':<48}{'plain mm':>10}{'refined mm':>12}{'seconds':>9}")
    for folder in sorted(data.glob("reghec_*")):
        views = read_scan(folder)
        samples = sample_views(views)
        began = time.perf_counter()
        found = register_views(views, samples, hand, refine=True)
        spent = time.perf_counter() - began
        after = found.after.rms_mm if found.after and found.after.rms_mm is not None else np.nan
        print(f"{folder.name:<48}{found.before.rms_mm:10.3f}{after:12.3f}{spent:9.1f}", flush=True)
    pairs(data / "reghec_david", hand)


def pairs(folder: Path, hand: ScannerMount) -> None:
    """Align the same 36 pairs one by one with other software, against our joint refinement."""
    views = read_scan(folder)
    surfaces = [sample.surface for sample in sample_views(views)]
    poses = [view.base_T_flange @ hand.flange_T_camera for view in views]

    def ours() -> None:
        refine_poses(surfaces, poses, [view.base_T_flange for view in views])

    heading("refinement of reghec_david, 36 pairs")
    if find_spec("small_gicp"):
        beside("ours", lambda: _pairs_of_small_gicp(surfaces, poses), ours, "small_gicp, the same pairs", 3)
    if find_spec("kiss_icp"):
        beside("ours", lambda: _pairs_of_kiss_icp(surfaces, poses), ours, "kiss-icp, the same pairs", 2)
    note(f"ours {best(ours, 2):.1f} s; one look at all pairs {best(lambda: agreement(surfaces, poses), 1):.2f} s")


def _pairs_of_small_gicp(surfaces: list[Surface], poses: list[np.ndarray]) -> None:
    import small_gicp

    clouds = [small_gicp.preprocess_points(surface.points, downsampling_resolution=0.7) for surface in surfaces]
    for one in range(len(poses)):
        for two in range(one):
            start = np.linalg.inv(poses[one]) @ poses[two]
            small_gicp.align(clouds[one][0], clouds[two][0], clouds[one][1], init_T_target_source=start)


def _pairs_of_kiss_icp(surfaces: list[Surface], poses: list[np.ndarray]) -> None:
    """Point to point in a voxel map, with settings for a scan of this size."""
    from kiss_icp.config import KISSConfig
    from kiss_icp.mapping import get_voxel_hash_map
    from kiss_icp.registration import get_registration

    config = KISSConfig()
    config.mapping.voxel_size = 0.7
    config.data.max_range = 1e4
    for one in range(len(poses)):
        world = get_voxel_hash_map(config)
        world.add_points(surfaces[one].points)
        for two in range(one):
            start = np.linalg.inv(poses[one]) @ poses[two]
            get_registration(config).align_points_to_map(surfaces[two].points, world, start, 4.0, 1.0)


def calibrations(data: Path) -> None:
    """X from the sphere, and from each object without a target, starting at the sphere's."""
    print(f"\n{'X from one object, nine views':<24}{'sigma mm':>22}{'sigma deg':>22}{'a point mm':>12}  verdict")
    sphere = solve_sphere_scan(read_scan(data / "reghec_sphere"), 48.37)
    _print_solution("sphere", sphere)
    assert sphere.mount_T_camera is not None
    found = {}
    for name in ("duck", "david", "mozart"):
        solution = solve_surface_scan(read_scan(data / f"reghec_{name}"), sphere.mount_T_camera)
        _print_solution(f"{name}, no target", solution)
        if solution.mount_T_camera is not None:
            found[name] = solution.mount_T_camera
    apart = [difference(one, two) for one, two in combinations(found.values(), 2)]
    largest_mm, largest_rad = np.max(apart, axis=0)
    note(f"largest difference between two objects' X: {largest_mm:.2f} mm, {np.degrees(largest_rad):.3f} deg")
    far = [difference(sphere.mount_T_camera, one) for one in found.values()]
    largest_mm, largest_rad = np.max(far, axis=0)
    note(f"largest difference from the sphere's X: {largest_mm:.1f} mm, {np.degrees(largest_rad):.2f} deg")


def _print_solution(name: str, solution: Solution) -> None:
    verdict = judge_scan(solution)
    if solution.uncertainty is None:
        print(f"{name:<24}{'none':>56}  refused")
        return
    mm = " ".join(f"{one:.2f}" for one in solution.uncertainty.translation_mm)
    degrees = " ".join(f"{one:.3f}" for one in np.degrees(solution.uncertainty.rotation_rad))
    codes = ", ".join(finding.code for finding in verdict.findings if finding.severity != "info")
    said = "accepted" if verdict.accepted else "not accepted"
    print(f"{name:<24}{mm:>22}{degrees:>22}{solution.uncertainty.point_mm:12.2f}  {said} ({codes})", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=10_000_000)
    parser.add_argument("--data", type=Path, default=Path(__file__).resolve().parents[3] / "shared" / "data")
    parser.add_argument("parts", nargs="*", choices=("kernel", "files", "voxels", "door", "real", "calibrations", []))
    options = parser.parse_args()
    parts: dict[str, Callable[[], None]] = {
        "kernel": lambda: (kernel(options.points), stream(options.points))[0],
        "files": lambda: files(options.points),
        "voxels": lambda: (voxels(options.points, 10.0), voxels(options.points, 3.0))[0],
        "door": door,
        "real": lambda: real(options.data),
        "calibrations": lambda: calibrations(options.data),
    }
    for name in options.parts or parts:
        if name in ("real", "calibrations") and not options.data.is_dir():
            print(f"{name}: no real data at {options.data}")
            continue
        parts[name]()


if __name__ == "__main__":
    main()
