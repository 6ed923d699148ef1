"""The shipped RAPID: it can be read, and it keeps a controller's limits."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from mock_robot.rapid.configuration import Fragments, task_plans
from mock_robot.rapid.errors import RapidSyntaxError
from mock_robot.rapid.instructions.table import DOES
from mock_robot.rapid.program import PersistentMemory, Program, builtins
from mock_robot.rapid.signals import Signal
from mock_robot.rapid.syntax import parse_module
from mock_robot.rapid.tasks import ProgramTask
from tests.mock_robot.rapid.rules import offences
from tests.mock_robot.rapid.snippets import raise_failure

RAPID = Path(__file__).parents[3] / "deploy" / "rapid"
MODULES = sorted(path for path in RAPID.iterdir() if path.suffix in (".mod", ".sys"))


HANDLER = re.compile(r"(\n +(?:FUNC|TRAP)\b.*?)\n  ERROR\n.*?(\n  END(?:FUNC|TRAP))", re.S)
"""rapidchecker 0.1.5 knows ERROR in a PROC alone; a controller knows it in every routine."""
LISTED = re.compile(r"(?m)^( *ERROR) \(\w+\)$")
"""Nor does it know the list of errors that a handler takes (RAPID kernel manual, error recovery with long jump)."""


@pytest.mark.slow
def test_rapidchecker_finds_nothing(tmp_path: Path) -> None:
    pytest.importorskip("rapidchecker", reason="rapidchecker is not installed")
    for module in MODULES:
        text = module.read_text("ascii")
        (tmp_path / module.name).write_text(LISTED.sub(r"\1", HANDLER.sub(r"\1\2", text)))
    command = [sys.executable, "-m", "rapidchecker", *(module.name for module in MODULES)]
    checked = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stdout


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.name)
def test_a_module_is_read_and_keeps_the_rules(path: Path) -> None:
    assert len(MODULES) == 5
    source = path.read_bytes()
    parse_module(source.decode("ascii"), path.name)
    assert offences(source) == []


def test_every_name_type_and_argument_is_known_to_the_controller() -> None:
    for plan in task_plans(Fragments(RAPID, 6)):
        signals = dict.fromkeys(
            ("cell_do_motors", "cell_do_estop", "cell_do_running", "cell_do_error"), Signal("any", "DO")
        )
        program = Program(ProgramTask(plan.name, raise_failure, plan.motion), PersistentMemory(), signals)
        program.load(plan.sources)
        assert callable(program.main())


def test_every_header_has_an_instruction_and_every_instruction_a_header() -> None:
    assert {builtin.name for builtin in builtins()} == set(DOES)


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
        "FUNC num a()\r\n  RETURN 1;\r\n  ENDFUNC",
        "TRAP a\r\n  ENDTRAP",
        "n := ReadBin(c);",
        "n := 8388609;",
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
