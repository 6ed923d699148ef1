"""The newcomer's first minute: `handeyed demo` as its own process, its curl lines as printed, and how it ends."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.daemon.cli.running import handeyed
from tests.support.terminal import started
from tests.support.waiting import eventually_blocking

LIMIT_S = 100.0

pytestmark = [pytest.mark.timeout(900), pytest.mark.slow]


class Demo:
    """A demo in a folder of its own."""

    def __init__(self, folder: Path, *options: str) -> None:
        self.folder = folder
        command = [sys.executable, "-m", "daemon.cli", "demo", *options]
        environment = os.environ | {"PYTHONUNBUFFERED": "1"}
        self.process = started(command, cwd=folder, env=environment, text=True)
        self.printed: list[str] = []

    def reads_until(self, words: str) -> None:
        """What is printed, up to a line with `words`."""
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.printed.append(line.rstrip("\n"))
            if words in line:
                return
        raise AssertionError(f"{words!r} was not printed: {self.printed} {self.process.communicate()}")

    def announced(self, name: str) -> dict[str, object]:
        """What a child announced, once it is there."""
        file = self.folder / ".demo" / f"{name}.json"
        eventually_blocking(file.exists)
        announcement: dict[str, object] = json.loads(file.read_text())
        return announcement

    def ends(self) -> tuple[int, str]:
        """Exit status and standard error; every child is gone."""
        pids = [int(str(self.announced(name)["pid"])) for name in ("mock-cell", "daemon")]
        out, err = self.process.communicate(timeout=LIMIT_S)
        self.printed += out.splitlines()
        assert not [pid for pid in pids if Path(f"/proc/{pid}").exists()]
        return self.process.returncode, err


@pytest.fixture
def demo(tmp_path: Path) -> Iterator[Callable[..., Demo]]:
    started: list[Demo] = []

    def start(*options: str) -> Demo:
        started.append(Demo(tmp_path, *options))
        return started[-1]

    yield start
    for one in started:
        if one.process.poll() is None:
            one.process.terminate()
        one.process.wait(LIMIT_S)
        for stream in (one.process.stdout, one.process.stderr):
            assert stream is not None
            stream.close()


def test_the_cell_is_calibrated_the_door_registered_and_the_printed_lines_work(demo: Callable[..., Demo]) -> None:
    cell = demo("--keep", "--time-scale", "20")
    cell.reads_until("frame.png")

    text = "\n".join(cell.printed)
    x_mm, point_mm, door_mm = (
        float(number) for number in re.findall(r"([\d.]+) mm(?: RMS|, [\d.]+ deg)$", text, re.MULTILINE)
    )
    assert point_mm < 0.4
    assert door_mm < 0.3
    assert x_mm < 1.0
    assert (cell.folder / ".demo" / "door.ply").read_bytes().startswith(b"ply\nformat binary")

    lines = [line.strip() for line in cell.printed if line.startswith("  curl ")]
    assert len(lines) == 3
    if shutil.which("curl"):
        for line in lines:
            done = subprocess.run(f"{line} --fail --silent --show-error", shell=True, cwd=cell.folder,
                                  capture_output=True, text=True, check=False)  # fmt: skip
            assert done.returncode == 0, (line, done.stderr)
        assert (cell.folder / "in_base.ply").read_bytes().startswith(b"ply\n")
        assert (cell.folder / "frame.png").read_bytes().startswith(b"\x89PNG")

    cell.process.send_signal(signal.SIGINT)
    assert cell.ends() == (0, "")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_demo_cut_short_leaves_nothing_behind(demo: Callable[..., Demo], number: signal.Signals) -> None:
    cut = demo("--time-scale", "0.5")
    cut.announced("daemon")

    cut.process.send_signal(number)

    status, err = cut.ends()
    assert status == 128 + number
    assert "Traceback" not in err


def test_a_step_that_fails_ends_the_demo_with_a_sentence(demo: Callable[..., Demo]) -> None:
    broken = demo("--time-scale", "0.5")
    control = broken.announced("mock-cell")["control"]
    pressed = urllib.request.Request(f"{control}/faults/robot-emergency-stop", method="POST")
    with urllib.request.urlopen(pressed) as answer:
        assert answer.status == 200
    broken.announced("daemon")

    status, err = broken.ends()

    assert status == 1
    assert "emergency stop" in err
    assert len(err.splitlines()) == 1


def test_a_folder_that_is_not_the_demos_is_left_alone(tmp_path: Path, demo: Callable[..., Demo]) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("dear")

    _, err = demo("--folder", "mine").process.communicate(timeout=LIMIT_S)

    assert "mine: this folder is not the demo's: give an empty one with --folder" in err
    assert (tmp_path / "mine" / "letter.txt").read_text() == "dear"


def test_the_demo_answers_programs_too(tmp_path: Path) -> None:
    ran = handeyed("demo", "--json", "--time-scale", "100", "--folder", tmp_path / "demo")

    assert ran.status == 0
    answer = json.loads(ran.out)
    assert answer["calibration"]["verdict"]["accepted"]
    assert answer["score"]["cloud"]["rms_mm"] < 0.3
    assert Path(answer["files"]["cloud"]).is_file()
