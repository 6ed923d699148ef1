"""`check`, `serve` and `calibrate` against a mock cell and a daemon, each a process of its own."""

import json
import re
import signal
import socket
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import httpx
import pytest

from calibration.documents.calibration import CalibrationDocument
from daemon.cli.demo_run.processes import ChildProcess, start_child
from daemon.cli.demo_run.scenario import settings_text
from tests.daemon.cli.running import handeyed
from tests.support.terminal import started
from tests.support.waiting import LIMIT_S

pytestmark = pytest.mark.slow

FAST = ["mock_robot", "run", "--with-parent", "--time-scale", "100"]


@dataclass(frozen=True)
class Running:
    """The cell's processes and the daemon's settings."""

    mock: ChildProcess
    daemon: ChildProcess
    settings: Path

    @property
    def url(self) -> str:
        url: str = self.daemon.announcement["url"]
        return url


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    folder = tmp_path_factory.mktemp("cell")
    with start_child("mock", FAST, folder) as mock:
        with socket.create_server(("127.0.0.1", 0)) as free:
            port = free.getsockname()[1]
        settings = folder / "handeyed.toml"
        settings.write_text(settings_text(mock.announcement, port))
        with start_child("daemon", ["daemon.cli", "serve", str(settings)], folder) as daemon:
            yield Running(mock, daemon, settings)


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[ChildProcess, Path]]:
    """A cell without a daemon."""
    folder = tmp_path_factory.mktemp("alone")
    with start_child("mock", FAST, folder) as mock:
        settings = folder / "handeyed.toml"
        settings.write_text(settings_text(mock.announcement, 1))
        yield mock, settings


def test_calibrate_prints_the_verdict_of_the_run(running: Running) -> None:
    ran = handeyed("calibrate", "--url", running.url, "--json")

    assert (ran.status, ran.err) == (0, "")
    document = CalibrationDocument.model_validate_json(ran.out)
    assert document.verdict.accepted
    stored = httpx.get(f"{running.url}/calibrations/{document.id}", timeout=LIMIT_S).json()
    assert stored["flange_T_camera"] == json.loads(ran.out)["flange_T_camera"]


def test_calibrate_in_words_says_whether_it_is_in_force(running: Running) -> None:
    ran = handeyed("calibrate", "--url", running.url, "--apply")

    assert ran.status == 0
    assert "accepted" in ran.out.splitlines()[0]
    waits = "it waits for a person" in ran.out
    assert ran.out.rstrip().endswith("active now") is not waits


def test_ctrl_c_stops_the_arm(running: Running) -> None:
    command = [sys.executable, "-m", "daemon.cli", "calibrate", "--url", running.url, "--count", "6"]
    with started(command) as asking:
        while (run := httpx.get(f"{running.url}/runs?limit=1", timeout=LIMIT_S).json()["runs"][0])["over"]:
            assert asking.poll() is None
            time.sleep(0.02)
        asking.send_signal(signal.SIGINT)
        asking.communicate(timeout=LIMIT_S)

    assert asking.returncode == 130
    assert httpx.get(f"{running.url}/runs/{run['id']}?wait=200", timeout=LIMIT_S).json()["state"] == "aborted"
    assert httpx.get(f"{running.url}/robot", timeout=LIMIT_S).json()["armed"] is False


def test_a_calibration_folder_of_the_daemon_can_be_solved_again(running: Running) -> None:
    run = httpx.post(f"{running.url}/calibrate", params={"wait": LIMIT_S}, timeout=2 * LIMIT_S).json()["id"]

    ran = handeyed("solve", running.settings.parent / "store" / "runs" / run, "--json")

    again = CalibrationDocument.model_validate_json(ran.out)
    first = CalibrationDocument.model_validate(httpx.get(f"{running.url}/calibrations/{run}", timeout=LIMIT_S).json())
    assert again.flange_T_camera is not None and first.flange_T_camera is not None
    assert again.flange_T_camera.translation_mm == pytest.approx(first.flange_T_camera.translation_mm, abs=1e-6)


def test_a_request_that_cannot_be_done_is_reported_with_what_to_do(running: Running, tmp_path: Path) -> None:
    (tmp_path / "request.json").write_text('{"cuont": 4}')

    ran = handeyed("calibrate", "--url", running.url, "--request", tmp_path / "request.json")

    assert ran.status == 2
    assert ran.errors == [f"{tmp_path / 'request.json'}: cuont: unknown key: did you mean 'count'?"]


def test_what_the_daemon_refuses_is_reported_in_its_words(running: Running, tmp_path: Path) -> None:
    here = {"translation_mm": [0, 0, 5000], "quaternion_wxyz": [1, 0, 0, 0]}
    (tmp_path / "request.json").write_text(json.dumps({"poses": [here] * 3}))

    ran = handeyed("calibrate", "--url", running.url, "--request", tmp_path / "request.json")

    assert ran.status == 1
    assert ran.err.startswith(f"{running.url}/calibrate: pose 1: the flange would stand at (0.0, 0.0, 5000.0) mm")


def test_check_asks_a_running_daemon_instead_of_its_devices(running: Running) -> None:
    ran = handeyed("check", running.settings)

    assert ran.status == 0
    assert [line.split()[:2] for line in ran.out.splitlines()] == [
        ["ok", "settings"], ["ok", "storage"], ["ok", "daemon"], ["ok", "cell"],
    ]  # fmt: skip


def test_a_second_daemon_on_the_same_store_is_refused_in_words(running: Running) -> None:
    ran = handeyed("serve", running.settings)

    assert ran.status == 1
    assert "is in use by another handeyed: stop that one" in ran.err


def test_a_second_daemon_at_the_same_port_is_refused_in_words(running: Running, tmp_path: Path) -> None:
    elsewhere = tmp_path / "handeyed.toml"
    settings = Path(running.settings).read_text()
    elsewhere.write_text(re.sub(r'(?m)^folder = ".*"$', f'folder = "{tmp_path / "store"}"', settings))
    ran = handeyed("serve", elsewhere)

    assert ran.status == 1
    assert str(httpx.URL(running.url).port) in ran.err


def test_check_says_a_line_for_each_device(alone: tuple[ChildProcess, Path]) -> None:
    _, settings = alone

    ran = handeyed("check", settings)

    assert ran.status == 0, ran.out
    lines = [line.split(None, 2) for line in ran.out.splitlines()]
    assert [line[:2] for line in lines] == [
        ["ok", name] for name in ("settings", "storage", "robot", "camera", "scanner")
    ]
    assert lines[2][2].startswith("answers and could move; the flange stands at (")
    assert lines[3][2].startswith("a picture of 1920 x 1200; ")


def test_check_waits_for_egm_and_says_when_none_comes(alone: tuple[ChildProcess, Path], tmp_path: Path) -> None:
    _, settings = alone
    egm = '[robot.egm]\nhost = "127.0.0.1"\nport = 0\nrobot = "127.0.0.1"\n'
    (tmp_path / "handeyed.toml").write_text(settings.read_text() + egm)

    ran = handeyed("check", tmp_path / "handeyed.toml", "--json")

    vibration = next(result for result in json.loads(ran.out) if result["name"] == "egm")
    assert ran.status == 1
    assert vibration["ok"] is False
    assert "EGMStreamStart" in vibration["fix"]


def test_check_says_what_to_do_where_nobody_answers(alone: tuple[ChildProcess, Path], tmp_path: Path) -> None:
    mock, settings = alone
    text = settings.read_text().replace(mock.announcement["camera"], "http://127.0.0.1:9/camera.png")
    text = text.replace("limit_s = 60.0", "limit_s = 1.0", 1)  # of the camera
    (tmp_path / "handeyed.toml").write_text(text)

    ran = handeyed("check", tmp_path / "handeyed.toml", "--json")

    camera = next(result for result in json.loads(ran.out) if result["name"] == "camera")
    assert ran.status == 1
    assert camera["ok"] is False
    assert "nobody answers" in camera["what"]
    assert camera["fix"]


def test_check_sees_a_robot_that_would_not_move(alone: tuple[ChildProcess, Path]) -> None:
    mock, settings = alone
    pressed = f"{mock.announcement['control']}/faults/robot-emergency-stop"
    httpx.post(pressed, timeout=LIMIT_S).raise_for_status()
    try:
        ran = handeyed("check", settings)
    finally:
        httpx.delete(pressed, timeout=LIMIT_S).raise_for_status()

    assert ran.status == 1
    assert "FAIL  robot     answers, but emergency stop is pressed" in ran.out


def test_no_daemon_is_reported_with_how_to_start_one() -> None:
    ran = handeyed("calibrate", "--url", "http://127.0.0.1:9")

    assert ran.status == 1
    assert ran.errors == [
        "http://127.0.0.1:9: no daemon answers: start it with 'handeyed serve CONFIG', or give its address with --url"
    ]


def test_an_address_that_is_none_is_reported() -> None:
    assert handeyed("calibrate", "--url", "cell-3").errors == [
        "cell-3: not an address: give one such as http://127.0.0.1:8372"
    ]


@pytest.mark.parametrize("command", ["serve", "check"])
def test_settings_that_cannot_be_read_are_reported(tmp_path: Path, command: str) -> None:
    file = tmp_path / "handeyed.toml"
    file.write_text('[robto]\naddress = "tcp://127.0.0.1:1"\n')

    ran = handeyed(command, file)

    assert ran.status == 2
    assert f"{file}: robto: unknown key: did you mean 'robot'?" in ran.errors
