"""The command as a whole: quick to start, complete, and honest about its version."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest
import typer

from calibration.closed_forms.registry import CLOSED_FORMS
from daemon.cli.main import app
from daemon.cli.solve import CLOSED_FORM_NAMES
from tests.daemon.cli.running import handeyed

HEAVY = (
    "asyncio",
    "importlib.metadata",
    "numpy",
    "scipy",
    "cv2",
    "pydantic",
    "fastapi",
    "uvicorn",
    "httpx",
    "calibration.solve",
    "daemon.composition",
)
COMMANDS = {"demo", "mock", "check", "serve", "calibrate", "target", "solve", "plan", "assess", "register", "version"}


def _python(code: str) -> str:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout


def test_nothing_heavy_is_imported_before_a_command_runs() -> None:
    loaded = json.loads(_python("import json, sys, daemon.cli.main; print(json.dumps(list(sys.modules)))"))

    assert not set(HEAVY) & set(loaded)


def _loaded_by(code: str) -> set[str]:
    return set(json.loads(_python(f"import json, sys; {code}; print(json.dumps(list(sys.modules)))").splitlines()[-1]))


@pytest.mark.parametrize("kind", ["chessboard", "circles"])
def test_a_target_is_printed_without_the_libraries_of_mathematics(kind: str, tmp_path: Path) -> None:
    """Neither has markers of OpenCV's, and the shapes are few enough for plain Python."""
    arguments = ["target", kind, "--out", str(tmp_path / "target.svg")]
    loaded = _loaded_by(f"from daemon.cli.main import app; app({arguments}, standalone_mode=False)")

    assert (tmp_path / "target.svg").exists()
    avoided = {"numpy", "scipy", "cv2", "asyncio", "http.client", "httpx", "fastapi", "daemon.config.settings"}
    assert not avoided & loaded


@pytest.mark.slow
def test_the_daemon_is_imported_without_what_only_a_run_or_some_cells_need() -> None:
    """scipy's parts are loaded by whoever solves; Modbus, certificates and clusters by the cells that have them."""
    loaded = _loaded_by("import daemon.composition")

    run = {"calibration.solve", "calibration.detection.detect"}
    some = run | {"aiohttp", "pymodbus", "cryptography", "dask", "extensions.plc.service", "drivers.interlocks"}
    assert not (some | {f"scipy.{part}" for part in ("stats", "spatial", "special", "optimize", "signal")}) & loaded


def test_every_command_is_there_and_has_a_help(tmp_path: Path) -> None:
    listed = handeyed("--help").out
    for command in COMMANDS:
        assert f" {command} " in listed
        if command != "mock":  # its --help is the mock's own
            assert handeyed(command, "--help").status == 0


def _commands(group: Any) -> Iterator[Any]:
    for command in group.commands.values():
        yield command
        if hasattr(command, "commands"):
            yield from _commands(command)


def test_no_word_in_brackets_is_lost_as_markup() -> None:
    for command in _commands(typer.main.get_command(app)):
        for text in (command.help, *(getattr(param, "help", None) for param in command.params)):
            assert not re.findall(r"(?<!\\)\[[a-z]", text or ""), text
    assert "[robot] model" in " ".join(handeyed("arms", "--help").out.split())


def test_the_help_of_solve_names_every_closed_form() -> None:
    assert ", ".join(CLOSED_FORMS) == CLOSED_FORM_NAMES
    assert "kronecker" in handeyed("solve", "--help").out


def test_the_shell_can_complete_commands() -> None:
    asked = os.environ | {"_HANDEYED_COMPLETE": "complete_bash", "COMP_WORDS": "handeyed s", "COMP_CWORD": "1"}
    command = [str(Path(sys.executable).with_name("handeyed"))]
    said = subprocess.run(command, capture_output=True, text=True, check=False, env=asked).stdout

    assert {"solve", "serve"} <= set(said.split())


def test_the_version_is_the_installed_one() -> None:
    assert json.loads(handeyed("version", "--json").out)["handeyed"] == metadata.version("handeyed")
    assert f"handeyed {metadata.version('handeyed')}" in handeyed("version").out


@pytest.mark.slow
def test_the_mock_is_a_program_of_its_own() -> None:
    command = [sys.executable, "-m", "daemon.cli", "mock"]
    faults = subprocess.run([*command, "faults", "--json"], capture_output=True, text=True, check=True)
    unknown = subprocess.run([*command, "run", "--fault", "no-such"], capture_output=True, text=True, check=False)

    assert len(json.loads(faults.stdout)) > 20
    assert unknown.returncode == 1
    assert "no-such" in unknown.stderr


def test_an_unknown_command_is_refused() -> None:
    assert handeyed("slove").status == 2


def test_every_file_that_is_written_is_named_by_o() -> None:
    def commands(group: Any) -> Iterator[Any]:
        for command in group.commands.values():
            yield from commands(command) if hasattr(command, "commands") else [command]

    options = [(command.name, one.opts) for command in commands(typer.main.get_command(app)) for one in command.params]
    written = [(name, opts) for name, opts in options if "--out" in opts]
    assert len(written) > 10
    assert [name for name, opts in written if "-o" not in opts] == []


@pytest.mark.parametrize(
    ("command", "redirection", "said"),
    [
        ("arms", ">/dev/full", "standard output: no space is left: free some, or write elsewhere\n"),
        ("schema session", ">/dev/full", "standard output: no space is left: free some, or write elsewhere\n"),
        ("init x.toml", "<&-", "the answers: they end before the last question: nothing was written\n"),
    ],
)
def test_what_the_shell_gives_or_takes_is_a_sentence(command: str, redirection: str, said: str, tmp_path: Path) -> None:
    """A full disk behind standard output, and a service or timer without any input."""
    script = f'exec "$0" -m daemon.cli {command} {redirection}'
    path = os.pathsep.join((str(Path.cwd()), os.environ.get("PYTHONPATH", "")))
    asked: dict[str, Any] = {"env": {**os.environ, "PYTHONPATH": path}, "cwd": tmp_path, "timeout": 120}
    ran = subprocess.run(
        ["/bin/sh", "-c", script, sys.executable], capture_output=True, text=True, check=False, **asked
    )
    assert (ran.returncode, ran.stderr) == (1, said)
    assert list(tmp_path.iterdir()) == []
