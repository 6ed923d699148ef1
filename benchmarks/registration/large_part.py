"""One large part of many views: time and peak memory of placing, refining and merging, by the number of points:
`python -m benchmarks.registration.large_part`.

Each size runs in a process of its own, whose largest resident memory is told. The views are strips of a bumpy plate
2 m x 1 m, each point seen by about three views; they are written first, and not counted.
"""

import argparse
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.registration.archive import pose
from benchmarks.registration.rows import cost
from calibration.kinematics.robot_accuracy import RobotNoise
from calibration.transforms import Array, inverse, map_points, rotation_from_vector, transform
from registration.fusion.merging import Merge
from registration.io.formats import ply
from registration.points.layout import XYZ_FLOAT32
from registration.scan import ScannerMount
from registration.scan_folder import read_scan, register_scan

LENGTH_MM, WIDTH_MM = 2000.0, 1000.0
STRIP_VIEWS = 3.0
"""How many views see a point, about."""

NOISE = RobotNoise(0.1, float(np.deg2rad(0.01)))
DISTINCT = 10**8
"""Points of a part that differ; what is larger repeats them, in multiples."""

WAYS = {"every": "every point", "voxel": "averaged", "refine": "refined, averaged"}


def write_part(folder: Path, views: int, points: int) -> None:
    """The scan of a plate in `views` strips with `points` points together."""
    random = np.random.default_rng(4)
    width = LENGTH_MM * STRIP_VIEWS / views
    documents = []
    for index in range(views):
        middle = 400.0 + LENGTH_MM * (index + 0.5) / views
        base_T_flange = transform(rotation_from_vector([np.pi, 0.0, 0.05 * np.sin(index)]), [middle, 0.0, 900.0])
        true = base_T_flange @ transform(
            rotation_from_vector(random.normal(0, NOISE.rotation_rad, 3)), random.normal(0, NOISE.translation_mm, 3)
        )
        count, distinct = points // views, min(points, DISTINCT) // views
        with (folder / f"view_{index:04}.ply").open("wb") as file:
            file.write(ply.format_header(XYZ_FLOAT32, count))
            seen = _plate(random, distinct, middle, width)
            content = map_points(inverse(true), seen).astype("<f4").tobytes()
            for _ in range(0, count, distinct):
                file.write(content)
        documents.append({"cloud": f"view_{index:04}.ply", "unit": "mm", "base_T_flange": pose(base_T_flange)})
    (folder / "scan.json").write_text(json.dumps({"schema_version": 1, "setup": "eye-in-hand", "views": documents}))


def _plate(random: np.random.Generator, count: int, middle: float, width: float) -> Array:
    x = random.uniform(middle - width / 2, middle + width / 2, count)
    y = random.uniform(-WIDTH_MM / 2, WIDTH_MM / 2, count)
    z = 200 + 15 * np.sin(x / 60) * np.cos(y / 45) + random.normal(0, 0.03, count)
    return np.column_stack([x, y, z])


def run(folder: Path, voxel_mm: float | None, *, refine: bool) -> None:
    """Register one part in this process and print its figures as JSON."""
    views = read_scan(folder)
    before = _peak_mb()
    mount, out = ScannerMount("benchmark", np.eye(4), NOISE), folder / "merged.ply"
    reports = []
    spent = cost(
        lambda: reports.append(register_scan(views, mount, out, _no_clock, refine=refine, merge=Merge(voxel_mm)))
    )
    print(json.dumps({
        "wall_s": spent.wall_s, "cpu_s": spent.cpu_s, "before_mb": before, "peak_mb": _peak_mb(),
        "points": reports[0].points, "rms": reports[0].rms_mm.model_dump(),
    }))  # fmt: skip


def _no_clock() -> float:
    return 0.0


def _peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--views", type=int, default=200)
    parser.add_argument("--points", type=float, nargs="+", default=[1e6, 1e7])
    parser.add_argument("--voxel-mm", type=float, default=1.0)
    parser.add_argument("--run", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=list(WAYS))
    options = parser.parse_args()
    if options.run is not None:
        (way,) = options.ways
        run(options.run, None if way == "every" else options.voxel_mm, refine=way == "refine")
        return 0
    print(f"{options.views} views; voxels of {options.voxel_mm:g} mm")
    head = f"{'points':>9}  {'':<22}{'clock s':>9}{'CPU s':>9}{'s per 1e6':>11}"
    print(f"{head}{'peak MB':>9}{'of it imports':>15}{'merged':>13}")
    for points in map(int, options.points):
        with tempfile.TemporaryDirectory(prefix="handeyed-bench-", dir=os.environ.get("TMPDIR")) as temporary:
            write_part(Path(temporary), options.views, points)
            for way in options.ways:
                print_row(points, WAYS[way], _in_a_child(temporary, way, options.voxel_mm))
            shutil.rmtree(temporary, ignore_errors=True)
            Path(temporary).mkdir()
    return 0


def _in_a_child(folder: str, way: str, voxel_mm: float) -> dict[str, float]:
    command = [sys.executable, "-m", "benchmarks.registration.large_part", "--run", folder, "--ways", way,
               "--voxel-mm", str(voxel_mm)]  # fmt: skip
    found: dict[str, float] = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    return found


def print_row(points: int, words: str, found: dict[str, float]) -> None:
    """One line of the table."""
    print(
        f"{points:9.0e}  {words:<22}{found['wall_s']:9.1f}{found['cpu_s']:9.1f}{found['cpu_s'] / points * 1e6:11.3f}"
        f"{found['peak_mb']:9.0f}{found['before_mb']:15.0f}{found['points']:13,}", flush=True,
    )  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
