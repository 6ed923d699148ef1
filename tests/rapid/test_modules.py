"""The shipped RAPID: it can be read, and it keeps a controller's limits."""

import subprocess
import sys
from pathlib import Path

import pytest

from mock_robot.rapid.rules import offences
from mock_robot.rapid.syntax import RapidSyntaxError, parse_module

RAPID = Path(__file__).parents[2] / "deploy" / "rapid"
MODULES = sorted(path for path in RAPID.iterdir() if path.suffix in (".mod", ".sys"))


def test_rapidchecker_finds_nothing(tmp_path: Path) -> None:
    pytest.importorskip("rapidchecker", reason="rapidchecker is not installed")
    command = [sys.executable, "-m", "rapidchecker", *map(str, MODULES)]
    checked = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stdout


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.name)
def test_a_module_is_read_and_keeps_the_rules(path: Path) -> None:
    assert len(MODULES) == 3
    source = path.read_bytes()
    parse_module(source.decode("ascii"), path.name)
    assert offences(source) == []


@pytest.mark.parametrize(
    "line",
    [
        "SocketReceive c \\RawData:=rb;",
        "SocketReceive c \\Str:=s \\Time:=1;",
        "StopMove \\Quick;",
        "SingArea \\Wrist;",
        "RETRY;",
        f"{'x' * 33};",
        f'TPWrite "{"x" * 81}";',
        "here := CRobT();",
        "PROC a()\r\n  ENDPROC",
        "! \N{DEGREE SIGN}",
        "! a line feed alone\n",
    ],
)
def test_each_rule_finds_its_offence(line: str) -> None:
    assert offences("MODULE a\r\n  x;\r\nENDMODULE\r\n".encode("latin-1")) == []
    assert offences(f"MODULE a\r\n  {line}\r\nENDMODULE\r\n".encode("latin-1"))


def test_what_cannot_be_read_names_file_and_line() -> None:
    with pytest.raises(RapidSyntaxError, match=r"CELL_x.mod:2: "):
        parse_module("MODULE a\n PROC b() GOTO; c: ENDPROC\nENDMODULE", "CELL_x.mod")
