"""The wheel: one package, `handeyed`, beside a plant whose own modules have the names of our rooms."""

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOMS = ("calibration", "daemon", "drivers", "extensions", "mock_robot", "protocols", "registration")
ROOT = Path(__file__).resolve().parents[2]
VERSION_1 = ROOT / "tests" / "calibration" / "documents" / "calibration_version_1.json"

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("hatchling", reason="hatchling is not installed")
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (file,) = folder.glob("*.whl")
    return file


@pytest.fixture(scope="module")
def beside_a_plant(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel's files, after modules of the plant that end the process when anybody imports them."""
    folder = tmp_path_factory.mktemp("plant")
    zipfile.ZipFile(wheel).extractall(folder)
    for room in ROOMS:
        (folder / f"{room}.py").write_text("raise SystemExit('a module of the plant was imported')")
    return folder


def run(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {"PYTHONPATH": str(folder), "PATH": "/usr/bin:/bin"}
    return subprocess.run(
        [sys.executable, *arguments], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


def test_it_has_one_package_with_every_room_below(wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    assert {name.split("/")[0].partition("-")[0] for name in names} == {"handeyed"}
    for room in ROOMS:
        assert f"handeyed/{room}/__init__.py" in names
    assert "handeyed/py.typed" in names
    assert {name for name in names if name.endswith((".mod", ".sys"))}
    assert "handeyed/mock_robot/rapid/rapid.lark" in names
    for words in ("calibration/sentences/words", "daemon/page/words", "daemon/reports/words"):
        assert {f"handeyed/{words}/{language}.json" for language in ("en", "de", "es", "zh")} <= set(names), words


def test_the_library_and_the_command_run_beside_modules_of_these_names(beside_a_plant: Path) -> None:
    listed = run(beside_a_plant, "-c", "import handeyed; print(*handeyed.__all__)")
    names = ["Client", "ClientError", "Session", "assess", "export", "plan", "read_cloud", "register", "solve"]
    assert listed.stdout.split() == names, listed.stderr
    exported = run(beside_a_plant, "-m", "handeyed", "export", str(VERSION_1), "--as", "kuka")
    assert "$TOOL={X" in exported.stdout, exported.stderr
    composed = run(beside_a_plant, "-c", "import handeyed.daemon.composition, handeyed.mock_robot.cell")
    assert composed.returncode == 0, composed.stderr
    printed = run(beside_a_plant, "-m", "handeyed", "schema", "session")
    assert printed.stdout == (ROOT / "docs" / "session.schema.json").read_text(), printed.stderr
    client = run(beside_a_plant, "-c", "import handeyed; handeyed.Client('http://127.0.0.1:1').close()")
    assert client.returncode == 0, client.stderr
    mock = run(beside_a_plant, "-m", "handeyed", "mock", "truth")
    assert "flange_T_camera" in mock.stdout, mock.stderr
