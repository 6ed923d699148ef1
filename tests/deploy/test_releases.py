"""deploy/handeyed-release against a systemd of four lines of shell: which release is current after each outcome."""

import os
import subprocess
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "deploy" / "handeyed-release"
RELEASES = ("0.1.0", "0.2.0")

SYSTEMCTL = """
case "$*" in
*is-active*) [ -e "$HERE/active" ] ;;
*StatusText*) line=$(head -n1 "$HERE/status"); echo "$line"
    if [ "$(wc -l <"$HERE/status")" -gt 1 ]; then sed -i 1d "$HERE/status"; fi ;;
"restart handeyed.service") basename "$(readlink "$HERE/opt/current")" >>"$HERE/started" ;;
esac
"""
"""`status` has what StatusText is at each look; the last line stays."""


class Machine:
    """A folder with two releases, of which 0.1.0 is current, and programs for the script."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for release in RELEASES:
            program = folder / "opt/releases" / release / "bin/handeyed"
            program.parent.mkdir(parents=True)
            self.let(release, "true")
        (folder / "opt/current").symlink_to("releases/0.1.0")
        (folder / "active").touch()
        (folder / "status").write_text("held, free for release 0.2.0\n")
        (folder / "bin").mkdir()
        programs = {"systemctl": SYSTEMCTL, "id": "echo 0", "sleep": "true", "journalctl": "echo no camera"}
        for name, body in programs.items():
            self._write(folder / "bin" / name, body)
        script = SCRIPT.read_text().replace("/run/systemd/system", str(folder))
        (folder / "handeyed-release").write_text(script)

    def let(self, release: str, body: str) -> None:
        """The release's program is this shell; its arguments are `check ...` and `health ...`."""
        self._write(self.folder / "opt/releases" / release / "bin/handeyed", body)

    def run(self, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
        given = {
            "PATH": f"{self.folder}/bin:{os.environ['PATH']}",
            "HERE": str(self.folder),
            "HANDEYED_ROOT": f"{self.folder}/opt",
            "HANDEYED_HOLD": f"{self.folder}/hold",
            **environment,
        }
        script = str(self.folder / "handeyed-release")
        return subprocess.run(["sh", script, *arguments], env=given, capture_output=True, text=True, check=False)

    @property
    def current(self) -> str:
        return (self.folder / "opt/current").readlink().name

    @property
    def started(self) -> list[str]:
        file = self.folder / "started"
        return file.read_text().split() if file.exists() else []

    @staticmethod
    def _write(file: Path, body: str) -> None:
        file.write_text(f"#!/bin/sh\n{body}\n")
        file.chmod(0o755)


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(tmp_path)


def test_a_release_that_answers_is_taken_into_use_and_back_leads_to_the_one_before(machine: Machine) -> None:
    ran = machine.run("use", "0.2.0")
    assert (ran.returncode, machine.current, machine.started) == (0, "0.2.0", ["0.2.0"]), ran.stderr
    assert machine.run().stdout == "0.1.0  before\n0.2.0  current\n"
    assert machine.run("back").returncode == 0
    assert (machine.current, machine.started) == ("0.1.0", ["0.2.0", "0.1.0"])
    assert not (machine.folder / "hold").exists()


def test_one_that_does_not_answer_gives_way_to_the_one_before(machine: Machine) -> None:
    machine.let("0.2.0", '[ "$1" = check ]')
    ran = machine.run("use", "0.2.0")
    assert (ran.returncode, machine.current, machine.started) == (1, "0.1.0", ["0.2.0", "0.1.0"])
    assert "no camera" in ran.stderr  # what it said
    assert "0.1.0 runs again, and 0.2.0 was not taken into use" in ran.stderr
    assert machine.run().stdout == "0.1.0  current\n0.2.0\n"  # it is nothing to go back to
    assert "no release before this one" in machine.run("back").stderr


def test_one_that_does_not_take_the_settings_is_not_started(machine: Machine) -> None:
    machine.let("0.2.0", '[ "$1" != check ]')
    ran = machine.run("use", "0.2.0")
    assert (ran.returncode, machine.current, machine.started) == (1, "0.1.0", [])
    assert "0.1.0 goes on" in ran.stderr


def test_a_run_in_progress_is_waited_for_and_named(machine: Machine) -> None:
    busy = "held, run 7 (calibrate) is in progress: release 0.2.0 waits for its end"
    (machine.folder / "status").write_text(f"run 7 (calibrate) is in progress\n{busy}\n{busy}\nheld, free for it\n")
    ran = machine.run("use", "0.2.0")
    assert (ran.returncode, machine.started) == (0, ["0.2.0"])
    assert ran.stdout.count("run 7 (calibrate) is in progress: release 0.2.0 waits for its end") == 1
    assert (machine.folder / "status").read_text() == "held, free for it\n"  # it looked until the run was over


@pytest.mark.parametrize(("options", "environment"), [(["--now"], {}), ([], {"HANDEYED_NOW": "1"})])
def test_a_run_in_progress_is_not_waited_for_when_it_must_be_now(
    machine: Machine, options: list[str], environment: dict[str, str]
) -> None:
    (machine.folder / "status").write_text("held, run 7 (calibrate) is in progress: ...\n")
    assert machine.run("use", "0.2.0", *options, **environment).returncode == 0
    assert machine.started == ["0.2.0"]


def test_an_older_daemon_that_knows_no_hold_is_not_waited_for(machine: Machine) -> None:
    (machine.folder / "status").write_text("\n")
    assert machine.run("use", "0.2.0").returncode == 0
    assert machine.started == ["0.2.0"]


def test_a_service_that_does_not_run_is_not_started(machine: Machine) -> None:
    (machine.folder / "active").unlink()
    assert machine.run("use", "0.2.0").returncode == 0
    assert (machine.current, machine.started) == ("0.2.0", [])


def test_now_ends_the_wait_of_an_update_and_nothing_else(machine: Machine) -> None:
    ran = machine.run("now")
    assert (ran.returncode, "no update waits" in ran.stderr) == (1, True)
    (machine.folder / "hold").touch()
    assert machine.run("now").returncode == 0
    assert (machine.folder / "hold.now").exists()
