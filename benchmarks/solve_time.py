"""Processor time of `handeyed solve`: `python -m benchmarks.solve_time [--folder DIR] [--solves 5]`.

Without a folder: 28 photographs of 9 MP, and as many of 2.3 MP, of a ChArUco board, taken with a lens that nobody has
measured, and eight views of given corners, all rendered first; and the 251 pictures of metric_1, in HANDEYED_DATA.
The command runs as a process of its own; user and system time are summed, and the least and the median are printed
beside their bar. The rows of the steps are of one more process of the first session, by the same clock.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from calibration.documents.pose import PoseDocument
from calibration.targets import Charuco
from calibration.transforms import inverse, rotation_from_vector, transform
from tests.simulated.views import industrial_camera, take_picture

BOARD = Charuco(14, 9, 20.0, 15.0, "DICT_5X5_100")
TARGET = {
    "kind": "charuco",
    "columns": 14,
    "rows": 9,
    "square_mm": 20.0,
    "marker_mm": 15.0,
    "dictionary": "DICT_5X5_100",
}
ROBOT_MM, ROBOT_RAD = 0.05, float(np.radians(0.01))
CORNER_NOISE_PX = 0.05
IMPORTS_BAR_S = 0.8


@dataclass(frozen=True)
class Rendered:
    """A session that is rendered: pictures of `size`, or the corners in them, and the bar of its solve."""

    name: str
    views: int
    size: tuple[int, int]
    is_of_pictures: bool
    bar_s: float


RENDERED = (
    Rendered("solve, 28 pictures of 9 MP", 28, (3504, 2628), True, 4.0),
    Rendered("solve, 28 pictures of 2.3 MP", 28, (1752, 1314), True, 3.0),
    Rendered("solve, 8 views of corners", 8, (1752, 1314), False, 0.3),
)
METRIC, METRIC_BAR_S = "solve, 251 pictures of metric_1", 7.0
FOLDER_BAR_S = 4.0

STEPS = """
import sys, time
from pathlib import Path
clock = time.process_time
begin = clock()
import daemon.cli.main, daemon.cli.solve
from daemon.sessions.session_reader import load_problem, open_session
from calibration.documents.calibration import calibration_document
from calibration.documents.planning_settings import NoiseExpectedDocument
from calibration.planning.what_if import PlanComparison
from calibration.solve import solve_hand_eye
from calibration.verdict import judge
marks = [("imports", clock() - begin + begin)]
def step(name, work):
    before = clock()
    result = work()
    marks.append((name, clock() - before))
    return result
problem = step("reading and detection", lambda: load_problem(open_session(Path(sys.argv[1])), lambda done, of: None))
solution = step("estimate", lambda: solve_hand_eye(problem))
step("verdict", lambda: judge(problem, solution))
def compare():
    better = PlanComparison.for_session(problem, solution, NoiseExpectedDocument().noise())
    return better and list(better.findings(problem, solution))
step("what better poses would give", compare)
for name, taken_s in marks:
    print(f"  {name:30} {taken_s:5.2f} s")
"""


def render_session(folder: Path, rendered: Rendered, seed: int = 14) -> None:
    """Write session.json and its photographs, eye-in-hand, with the noise of an ordinary robot and no intrinsics."""
    rng = np.random.default_rng(seed)
    camera = industrial_camera(*rendered.size)
    flange_T_camera = transform(rotation_from_vector(rng.standard_normal(3)), 80 * rng.standard_normal(3))
    base_T_target = transform(rotation_from_vector(rng.standard_normal(3)), 500 * rng.standard_normal(3))
    views = []
    for index in range(rendered.views):
        picture = take_picture(camera, BOARD, rng)
        error = transform(rotation_from_vector(ROBOT_RAD * rng.standard_normal(3)), ROBOT_MM * rng.standard_normal(3))
        base_T_flange = base_T_target @ inverse(flange_T_camera @ picture.camera_T_target) @ error
        view: dict[str, Any] = {"base_T_flange": PoseDocument.of(base_T_flange).model_dump(exclude_none=True)}
        if rendered.is_of_pictures:
            view["image"] = f"view_{index:03d}.jpg"
            cv2.imwrite(str(folder / view["image"]), picture.image, [cv2.IMWRITE_JPEG_QUALITY, 95])
        else:
            seen = picture.pixels + CORNER_NOISE_PX * rng.standard_normal(picture.pixels.shape)
            view["corners_px"] = [[corner, *pixel] for corner, pixel in enumerate(seen.tolist())]
        views.append(view)
    session = {"schema_version": 1, "setup": "eye-in-hand", "target": TARGET, "camera": None, "views": views}
    if not rendered.is_of_pictures:
        session["image_size"] = list(rendered.size)
    (folder / "session.json").write_text(json.dumps(session))


def processor_s(arguments: list[str], shown: int | None = subprocess.DEVNULL) -> float:
    """User and system time of one process of Python with these arguments. Exits when it fails."""
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    environment = {**kept, "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(Path(__file__).resolve().parents[1])}
    process = subprocess.Popen([sys.executable, *arguments], stdout=shown, env=environment)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode not in (0, 3):  # 3: solved, not accepted
        raise SystemExit(f"{' '.join(arguments)} ended with status {process.returncode}")
    return usage.ru_utime + usage.ru_stime


def sessions(temporary: Path, given: Path | None) -> Iterator[tuple[str, Path, float]]:
    """Name, folder and bar of each session to solve; those that are rendered are written on the way."""
    if given is not None:
        yield "solve", given, FOLDER_BAR_S
        return
    for number, rendered in enumerate(RENDERED):
        folder = temporary / str(number)
        folder.mkdir()
        render_session(folder, rendered)
        yield rendered.name, folder, rendered.bar_s
    root = Path(os.environ.get("HANDEYED_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))
    if (root / "metric_1").is_dir():
        yield METRIC, root / "metric_1", METRIC_BAR_S
    else:
        print(f"{METRIC}: {root / 'metric_1'} is not there, set HANDEYED_DATA")


def print_row(name: str, command: list[str], bar_s: float, runs: int) -> bool:
    """Time the command and print its row; whether the least is within the bar."""
    taken_s = [processor_s(command) for _ in range(runs)]
    least_s, median_s = min(taken_s), statistics.median(taken_s)
    print(f"{name:32} {least_s:6.2f} s, median {median_s:6.2f} s (bar {bar_s} s)", flush=True)
    return least_s <= bar_s


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, help="a folder with session.json in place of the others")
    parser.add_argument("--solves", type=int, default=5)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        asked = list(sessions(Path(temporary), given.folder))
        commands = [(name, ["-m", "daemon.cli", "solve", str(folder)], bar_s) for name, folder, bar_s in asked]
        commands.append(("imports", ["-c", STEPS.split("marks =")[0]], IMPORTS_BAR_S))
        within = [print_row(name, command, bar_s, given.solves) for name, command, bar_s in commands]
        processor_s(["-c", STEPS, str(asked[0][1])], None)
    return int(not all(within))


if __name__ == "__main__":
    sys.exit(main())
