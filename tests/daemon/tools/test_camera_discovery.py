"""`handeyed devices`: cameras that answer, and interfaces that cannot look."""

from json import loads

from typer.testing import CliRunner

from daemon.cli.main import app
from daemon.tools.camera_discovery import discover
from drivers.cameras.genicam.device import VendorError
from drivers.errors import LibraryMissing
from tests.support.vendor_cameras import SERIAL, gigabit_camera, require_pylon


class Failing:
    def __init__(self, error: Exception) -> None:
        self.error = error

    def discover(self):
        raise self.error


def test_an_interface_that_cannot_look_says_why(tmp_path):
    (tmp_path / "video0").touch()
    libraries = {
        "basler": lambda: Failing(LibraryMissing("camera", "pypylon is not installed", "pip install it")),
        "genicam": lambda: Failing(VendorError("no transport layer")),
    }
    basler, genicam, video = discover(libraries, tmp_path)
    assert (basler.problem, basler.fix) == ("pypylon is not installed", "pip install it")
    assert "no transport layer" in genicam.line()
    assert video.address == f"video:{tmp_path / 'video0'}"


def test_pylons_cameras_are_listed_with_what_they_can(monkeypatch):
    require_pylon(monkeypatch, cameras=2)
    answer = CliRunner().invoke(app, ["devices", "--json"])
    assert answer.exit_code == 0, answer.output
    cameras = {entry["address"]: entry for entry in loads(answer.stdout) if entry["vendor"] == "Basler"}
    assert cameras.keys() == {"basler:0815-0000", "basler:0815-0001"}
    assert {"exposure", "software trigger", "Mono12"} <= set(cameras["basler:0815-0001"]["abilities"])


def test_a_gige_vision_camera_is_listed_with_its_network_address():
    with gigabit_camera():
        answer = CliRunner().invoke(app, ["devices"])
    (line,) = [line for line in answer.stdout.splitlines() if line.startswith(f"aravis:{SERIAL}")]
    assert f"Aravis Fake; serial number {SERIAL}; 127.0.0.1; exposure" in line
