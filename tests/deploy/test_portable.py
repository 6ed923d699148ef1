"""The file commands without the modules and flags that only POSIX has. The daemon stays on Linux."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from calibration.documents.pose import PoseDocument
from handeyed import read_cloud
from tests.daemon.cli.sessions import CAMERA, TILTS_RAD, base_T_flange, picture, with_corners

ROOT = Path(__file__).resolve().parents[2]
VERSION_1 = ROOT / "tests" / "calibration" / "documents" / "calibration_version_1.json"

HIDDEN = """
import os, runpy, sys
HIDDEN = ("fcntl", "resource", "termios", "tty", "pty", "pwd", "grp", "syslog", "uvloop", "httptools")
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in HIDDEN:
            raise ModuleNotFoundError(f"{name} is hidden", name=name)
sys.meta_path.insert(0, Absent())
for name in list(sys.modules):
    if name in HIDDEN:
        del sys.modules[name]
ABSENT = (
    "O_NONBLOCK O_NOCTTY O_CLOEXEC O_NOFOLLOW O_DIRECTORY getuid geteuid fork openpty preadv pread pwritev pwrite "
    "posix_fallocate posix_fadvise sendfile copy_file_range fchmod fchown sched_getaffinity statvfs mkfifo sync chown"
)
for name in ABSENT.split():
    if hasattr(os, name):
        delattr(os, name)
"""


STEPS = """
import json
from daemon.cli.main import app
for step in json.loads(sys.argv[1]):
    try:
        app(step, standalone_mode=False)
    except SystemExit as ended:
        assert not ended.code, (step, ended.code)
"""


def scan(folder: Path) -> Path:
    """A cloud of 100 points for every pose."""
    folder.mkdir()
    views = []
    for at, tilt in enumerate(TILTS_RAD):
        points = np.random.default_rng(at).uniform(100, 400, (100, 3))
        head = "ply\nformat ascii 1.0\nelement vertex 100\n" + "".join(f"property float {axis}\n" for axis in "xyz")
        rows = "".join(f"{x:.4f} {y:.4f} {z:.4f}\n" for x, y, z in points.tolist())
        (folder / f"{at}.ply").write_text(f"{head}end_header\n{rows}", encoding="ascii", newline="\n")
        pose = PoseDocument.of(base_T_flange(tilt)).model_dump(mode="json")
        views.append({"cloud": f"{at}.ply", "unit": "mm", "base_T_flange": pose})
    document = {"schema_version": 1, "setup": "eye-in-hand", "views": views}
    (folder / "scan.json").write_text(json.dumps(document), encoding="utf-8")
    return folder


def run(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """In a process whose output has a Western code page, and in which text files need an encoding to be given."""
    environment = os.environ | {"PYTHONIOENCODING": "cp1252:strict", "PYTHONWARNDEFAULTENCODING": "1"}
    warning = ("-W", "error::EncodingWarning:daemon", "-W", "error::EncodingWarning:calibration")
    return subprocess.run(
        [sys.executable, *warning, "-c", HIDDEN + code, *arguments],
        cwd=ROOT, env=environment, capture_output=True, text=True, encoding="cp1252", check=False,
    )  # fmt: skip


@pytest.mark.slow
def test_session_to_report_without_posix(tmp_path: Path) -> None:
    session, out = with_corners(tmp_path / "session"), tmp_path / "calibration.json"
    steps = [
        ["solve", str(session), "--out", str(out)],
        ["compare", str(out), str(out)],
        ["export", str(out), "--as", "rapid", "--out", str(tmp_path / "x.mod")],
        ["report", str(out), "--out", str(tmp_path / "r.html")],
        ["target", "chessboard", "--out", str(tmp_path / "t.svg")],
        ["arms"],
    ]
    ran = run(STEPS, json.dumps(steps))
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert (tmp_path / "x.mod").read_bytes().startswith(b"MODULE")


@pytest.mark.slow
def test_photographs_to_a_registered_cloud_without_posix(tmp_path: Path) -> None:
    photos, calibration = tmp_path / "photos", tmp_path / "calibration.json"
    photos.mkdir()
    rows = ["image,x,y,z,qw,qx,qy,qz"]
    for at, tilt in enumerate(TILTS_RAD):
        (photos / f"{at}.png").write_bytes(picture(tilt))
        pose = PoseDocument.of(base_T_flange(tilt))
        rows.append(",".join(map(str, (f"{at}.png", *pose.translation_mm, *pose.quaternion_wxyz))))
    (photos / "poses.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    camera = {"matrix": CAMERA.matrix.tolist(), "distortion": [0, 0, 0, 0, 0], "image_size": [640, 480]}
    (tmp_path / "camera.json").write_text(json.dumps(camera), encoding="utf-8")
    target = ["--target", "charuco:7x5:30:22:DICT_5X5_100", "--setup", "eye-in-hand"]
    steps = [
        ["import", str(photos), "--out", str(tmp_path / "session"), "--camera", str(tmp_path / "camera.json"), *target],
        ["solve", str(tmp_path / "session"), "--tolerance", "100", "--out", str(calibration)],
        *(["register", str(scan(tmp_path / f"scan_{name}")), "--calibration", str(calibration), "--out",
           str(tmp_path / name)] for name in ("a.ply", "a.npy", "a.xyz")),
    ]  # fmt: skip
    ran = run(STEPS, json.dumps(steps))
    assert ran.returncode == 0, ran.stdout + ran.stderr
    clouds = [read_cloud(tmp_path / name, unit="mm") for name in ("a.ply", "a.xyz")]
    np.testing.assert_allclose(clouds[0], np.load(tmp_path / "a.npy"), atol=0.001)
    np.testing.assert_allclose(clouds[0], clouds[1], atol=0.001)


def test_library_and_mock_are_imported_without_posix() -> None:
    ran = run("import handeyed, registration.report, registration.calibrate, mock_robot.__main__, mock_robot.cell")
    assert ran.returncode == 0, ran.stderr
