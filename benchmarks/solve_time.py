"""Processor time of `handeyed solve`: `python -m benchmarks.solve_time [--folder DIR] [--solves 3]`.

Without a folder 28 photographs of 9 MP of a ChArUco board, taken with a lens that nobody has measured, are rendered
first. The command runs as a process of its own on one core's worth of threads; user and system time are summed, and the
median is printed beside its bar. The rows of the steps are of one more process, by the same clock.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

from calibration.documents.pose import PoseDocument
from calibration.targets import Charuco
from calibration.transforms import inverse, rotation_from_vector, transform
from tests.simulated.views import industrial_camera, take_picture

VIEWS, SIZE = 28, (3504, 2628)
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
BARS_S = {"solve": 4.0, "imports": 0.8}

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


def render_session(folder: Path, seed: int = 14) -> None:
    """Write session.json and 28 photographs, eye-in-hand, with the noise of an ordinary robot and no intrinsics."""
    rng = np.random.default_rng(seed)
    camera = industrial_camera(*SIZE)
    flange_T_camera = transform(rotation_from_vector(rng.standard_normal(3)), 80 * rng.standard_normal(3))
    base_T_target = transform(rotation_from_vector(rng.standard_normal(3)), 500 * rng.standard_normal(3))
    views = []
    for index in range(VIEWS):
        picture = take_picture(camera, BOARD, rng)
        error = transform(rotation_from_vector(ROBOT_RAD * rng.standard_normal(3)), ROBOT_MM * rng.standard_normal(3))
        base_T_flange = base_T_target @ inverse(flange_T_camera @ picture.camera_T_target) @ error
        name = f"view_{index:03d}.jpg"
        cv2.imwrite(str(folder / name), picture.image, [cv2.IMWRITE_JPEG_QUALITY, 95])
        views.append({"image": name, "base_T_flange": PoseDocument.of(base_T_flange).model_dump(exclude_none=True)})
    session = {"schema_version": 1, "setup": "eye-in-hand", "target": TARGET, "camera": None, "views": views}
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


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, help="a folder with session.json in place of the rendered one")
    parser.add_argument("--solves", type=int, default=3)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = given.folder or Path(temporary)
        if given.folder is None:
            render_session(folder)
        imports = STEPS.split("marks =")[0]
        commands = {"solve": ["-m", "daemon.cli", "solve", str(folder)], "imports": ["-c", imports]}
        taken_s = {
            name: statistics.median(processor_s(command) for _ in range(given.solves))
            for name, command in commands.items()
        }
        for name, seconds in taken_s.items():
            print(f"{name:32} {seconds:5.2f} s (bar {BARS_S[name]} s)", flush=True)
        processor_s(["-c", STEPS, str(folder)], None)
    return int(any(seconds > BARS_S[name] for name, seconds in taken_s.items()))


if __name__ == "__main__":
    sys.exit(main())
