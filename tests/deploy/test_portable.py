"""The file commands without the modules and flags that only POSIX has. The daemon stays on Linux."""

import json
import subprocess
import sys
from pathlib import Path

from tests.daemon.cli.sessions import with_corners

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
ABSENT = "O_NONBLOCK O_NOCTTY O_CLOEXEC O_NOFOLLOW O_DIRECTORY getuid geteuid fork openpty"
for name in ABSENT.split():
    if hasattr(os, name):
        delattr(os, name)
"""


def run(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", HIDDEN + code, *arguments], cwd=ROOT, capture_output=True, text=True, check=False
    )


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
    code = """
import json
from daemon.cli.main import app
for step in json.loads(sys.argv[1]):
    try:
        app(step, standalone_mode=False)
    except SystemExit as ended:
        assert not ended.code, (step, ended.code)
import click
"""
    ran = run(code, json.dumps(steps))
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert (tmp_path / "x.mod").read_bytes().startswith(b"MODULE")


def test_library_and_mock_are_imported_without_posix() -> None:
    ran = run("import handeyed, registration.report, registration.calibrate, mock_robot.__main__, mock_robot.cell")
    assert ran.returncode == 0, ran.stderr
