"""Registers an archive by one process and by 1, 2, 4 and 8 Dask workers, and states the cost as a model:
`python -m benchmarks.registration.archive`.

What n workers take on as many free cores is the path: the processor time of the client and of the busiest worker.
Other work on the machine, or fewer cores than workers, lengthen the clock's time and change the path little. The model
of the path is T(n) = client + work / n, with both from the run with one worker; residuals are those of the path. A
straight line through the processor times of all says what a worker more costs.
"""

import argparse
import importlib.util
import json
import os
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.registration.rows import Cost, cost
from calibration.transforms import inverse, map_points, rotation_from_vector, transform
from daemon.tools.batch_registration.archive_run import open_executor, run_here
from daemon.tools.batch_registration.tasks import RegistrationTask
from registration.io.formats import ply
from registration.points.layout import XYZ_FLOAT32

MEASURED = (1, 2, 4, 8)
BEYOND = (16, 32)


def an_archive(folder: Path, scans: int, points: int) -> list[str]:
    """Scans of three views each."""
    names = []
    rng = np.random.default_rng(0)
    patch = rng.uniform([750, -100, 240], [950, 100, 260], (points, 3))
    for scan in range(scans):
        names.append(f"part_{scan:04d}")
        (folder / names[-1]).mkdir(parents=True)
        views = []
        for index in range(3):
            base_T_flange = transform(rotation_from_vector([3.1, 0.1 * index, 0.01 * scan]), [800.0, 0, 700])
            seen = map_points(inverse(base_T_flange), patch).astype("<f4")
            content = ply.format_header(XYZ_FLOAT32, points) + seen.tobytes()
            (folder / names[-1] / f"view_{index}.ply").write_bytes(content)
            views.append({"cloud": f"view_{index}.ply", "unit": "mm", "base_T_flange": pose(base_T_flange)})
        document = {"schema_version": 1, "setup": "eye-in-hand", "views": views}
        (folder / names[-1] / "scan.json").write_text(json.dumps(document))
    return names


def pose(base_T_flange: np.ndarray) -> object:
    from calibration.documents.pose import PoseDocument

    return PoseDocument.of(base_T_flange).model_dump(mode="json")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scans", type=int, default=24)
    parser.add_argument("--points", type=int, default=100_000)
    options = parser.parse_args()
    if importlib.util.find_spec("distributed") is None:
        print("distributed is not installed: install handeyed[archive]")
        return 0
    from tests.daemon.calibrations import a_calibration

    calibration = a_calibration("benchmark").model_dump_json()
    with tempfile.TemporaryDirectory(prefix="handeyed-bench-") as temporary:
        folder = Path(temporary)
        scans = an_archive(folder / "in", options.scans, options.points)

        def tasks(out: str) -> list[RegistrationTask]:
            return [RegistrationTask(str(folder / "in"), str(folder / out), scan, calibration) for scan in scans]

        list(run_here(tasks("warm")[:1]))
        spent = {0: cost(lambda: list(run_here(tasks("here"))))}
        paths_s = {}
        for workers in MEASURED:
            with open_executor("local", workers) as run:
                list(run(tasks(f"warm{workers}")[: 2 * workers]))  # pays for imports once, not per scan
                before = _busy_s(os.getpid())
                spent[workers] = cost(lambda w=workers, r=run: list(r(tasks(f"out{w}"))))  # type: ignore[misc]
                used = {pid: busy_s - before.get(pid, 0.0) for pid, busy_s in _busy_s(os.getpid()).items()}
                spent[workers] = replace(spent[workers], cpu_s=sum(used.values()))
                client_s = used.pop(os.getpid())
                paths_s[workers] = client_s, max(used.values())
    print_table(options.scans, spent, paths_s)
    return 0


def _busy_s(pid: int) -> dict[int, float]:
    """Processor seconds of a process and of each of its running children."""
    own = sum(map(int, Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2].split()[11:13]))
    busy_s = {pid: own / os.sysconf("SC_CLK_TCK")}
    for thread in Path(f"/proc/{pid}/task").iterdir():
        for child in (thread / "children").read_text().split():
            busy_s |= _busy_s(int(child))
    return busy_s


def print_table(scans: int, spent: dict[int, Cost], paths_s: dict[int, tuple[float, float]]) -> None:
    """Print the table, and the line through the processor times. `paths_s`: of the client and of the busiest worker."""
    client_s, work_s = paths_s[1]
    heads = f"{'clock s':>10}{'CPU s':>10}{'path s':>10}{'x one worker':>14}{'model s':>10}{'residual s':>12}"
    print(f"{f'{scans} scans':<20}{heads}")
    print(f"{'this process':<20}{spent[0].wall_s:10.2f}{spent[0].cpu_s:10.2f}")
    for workers, parts_s in paths_s.items():
        name, path_s, model_s = f"{workers} workers", sum(parts_s), client_s + work_s / workers
        print(f"{name:<20}{spent[workers].wall_s:10.2f}{spent[workers].cpu_s:10.2f}{path_s:10.2f}"
              f"{(client_s + work_s) / path_s:14.2f}{model_s:10.2f}{path_s - model_s:+12.2f}")  # fmt: skip
    for workers in BEYOND:
        model_s = client_s + work_s / workers
        print(f"{f'{workers} workers':<20}{'':>30}{(client_s + work_s) / model_s:14.2f}{model_s:10.2f}  by the model")
    counts, cpu_s = np.array([[workers, each.cpu_s] for workers, each in spent.items() if workers]).T
    slope, start = np.polyfit(counts, cpu_s, 1)
    off = ", ".join(f"{each:+.2f}" for each in cpu_s - (start + slope * counts))
    print(f"processor time: {start:.2f} s and {slope:.2f} s for each worker; residuals {off} s")


if __name__ == "__main__":
    sys.exit(main())
