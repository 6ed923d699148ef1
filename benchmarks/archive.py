"""An archive registered by one process and by 1 and 2 Dask workers, and what that says of more of them:
`python -m benchmarks.archive`.

The model is T(n) = start + serial + work / n: `serial` is what the client alone does (listing, submitting), `work`
what the workers do; both from the run in one process and the run with one worker. It is checked by the run with two.
"""

import argparse
import importlib.util
import json
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from calibration.transforms import inverse, map_points, rotation_from_vector, transform
from daemon.archive.engines import engine, in_this_process
from daemon.archive.work import Task
from registration.formats import ply
from registration.layout import XYZ_FLOAT32

BEYOND = (4, 8, 16, 32)


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

        def tasks(out: str) -> list[Task]:
            return [Task(str(folder / "in"), str(folder / out), scan, calibration) for scan in scans]

        list(in_this_process(tasks("warm")[:1]))
        spent = {0: seconds(lambda: list(in_this_process(tasks("here"))))}
        for workers in (1, 2):
            with engine("local", workers) as run:
                list(run(tasks(f"warm{workers}")[: 2 * workers]))  # imports are paid once, not for each scan
                spent[workers] = seconds(lambda w=workers, r=run: list(r(tasks(f"out{w}"))))  # type: ignore[misc]
    tell(options.scans, spent)
    return 0


def seconds(work: object) -> float:
    began = time.perf_counter()
    work()  # type: ignore[operator]
    return time.perf_counter() - began


def tell(scans: int, spent: dict[int, float]) -> None:
    work, serial = spent[0], max(0.0, spent[1] - spent[0])
    print(f"{scans} scans in one process {spent[0]:.2f} s; each {1000 * spent[0] / scans:.0f} ms")
    for workers in (1, 2):
        told = serial + work / workers
        print(
            f"{workers} workers {spent[workers]:8.2f} s  {spent[1] / spent[workers]:5.2f} x one  (model {told:.2f} s)"
        )
    for workers in BEYOND:
        told = serial + work / workers
        print(f"{workers} workers {told:8.2f} s  {spent[1] / told:5.2f} x one (model)")


if __name__ == "__main__":
    sys.exit(main())
