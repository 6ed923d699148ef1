"""Error handlers of RAPID: RETRY, TRYNEXT, RAISE, RETURN and UNDO, by small programs."""

import re

import pytest

from mock_robot.rapid import statements
from mock_robot.rapid.controller import DEPLOYED
from mock_robot.rapid.errors import CycleLeft, ProgramStopped
from tests.mock_robot.rapid.snippets import Snippet, module, ran

RAISER = """VAR num n;
VAR num seen;
---
PROC Fails()
  VAR num zero;
  n := 1;
  n := 1 / zero;
  n := n + 100;
ERROR
  RAISE;
ENDPROC
PROC Silent()
  VAR num zero;
  n := 1 / zero;
ENDPROC
"""


def test_trynext_goes_on_behind_the_failed_instruction_of_the_routine_that_handles() -> None:
    snippet = ran("Fails;\nn := n + 5;", RAISER, "IF ERRNO = ERR_DIVZERO THEN\nseen := 1;\nTRYNEXT;\nENDIF\nRAISE;")
    assert (snippet["n"], snippet["seen"]) == (6, 1)


def test_trynext_after_a_failed_condition_jumps_past_the_loop() -> None:
    body = "WHILE 1 / n > 0 DO\nn := n - 1;\nENDWHILE\nseen := 7;"
    assert ran(body, "VAR num n := 2;\nVAR num seen;", "TRYNEXT;")["seen"] == 7


def test_return_in_a_handler_leaves_the_routine() -> None:
    assert ran("Fails;\nn := 50;", RAISER, "seen := 3;\nRETURN;")["n"] == 1


def test_retry_does_it_again_four_times_at_most() -> None:
    data = "VAR num n := -2;\nVAR num seen;"
    assert ran("seen := Sqrt(n);", data, "n := n + 1;\nRETRY;")["n"] == 0
    with pytest.raises(ProgramStopped, match="retried 4 times"):
        ran("seen := Sqrt(n);", data, "RETRY;")


def test_a_routine_without_a_handler_does_not_pass_its_error_on_the_program_stops() -> None:
    with pytest.raises(ProgramStopped, match=r"ERR_DIVZERO.*silent has no ERROR handler") as stopped:
        ran("Silent;", RAISER, "TRYNEXT;")
    assert stopped.value.code == 10020
    assert stopped.value.where == "TEST.mod:16"


def test_an_error_inside_a_handler_stops_the_program() -> None:
    with pytest.raises(ProgramStopped, match="inside an ERROR handler"):
        ran("Fails;", RAISER, "n := n / 0;\nTRYNEXT;")


def test_raise_out_of_main_stops_the_program() -> None:
    with pytest.raises(ProgramStopped, match="raised out of main"):
        ran("Fails;", RAISER, "RAISE;")


def test_undo_runs_when_routines_are_dropped() -> None:
    inner = "PROC Inner()\nExitCycle;\nUNDO\nn := n + 1;\nENDPROC\n"
    around = f"VAR num n;\n---\n{inner}PROC Outer()\nInner;\nUNDO\nn := 10 * n;\nENDPROC"
    snippet = Snippet(module("Outer;", around))
    with pytest.raises(CycleLeft):
        snippet.runs()
    assert snippet["n"] == 10


def test_undo_runs_at_once_without_traps_though_the_program_is_stopped() -> None:
    trap = "TRAP on_bell\nrung := rung + 1;\nENDTRAP\n"
    begins = "CONNECT number WITH on_bell;\nIPers bell, number;\nExitCycle;"
    inner = f"PROC Inner()\n{begins}\nUNDO\nbell := 3;\nn := 1;\nENDPROC\n"
    around = f"VAR num n;\nVAR num rung;\nVAR intnum number;\nPERS num bell := 0;\n---\n{trap}{inner}"
    snippet = Snippet(module("Inner;", around))
    with pytest.raises(CycleLeft):
        snippet.runs()
    assert (snippet["n"], snippet["rung"]) == (1, 0)


@pytest.mark.parametrize(
    ("body", "error"),
    [
        ('s := "' + 41 * "x" + '" + "' + 40 * "y" + '";', "ERR_STRTOOLNG"),
        ("n := list{4};", "ERR_OUTOFBND"),
        ("n := list{0};", "ERR_OUTOFBND"),
        ("n := 9E9 MOD 2;", "ERR_INT_MAXVAL"),
        ("n := 2.5 MOD 2;", "ERR_INT_NOTVAL"),
        ("n := 1E38 * 10;", "ERR_NUM_LIMIT"),
        ("n := 1 MOD 0;", "ERR_DIVZERO"),
        ("UnpackRawBytes rb, 1, n \\IntX:=USINT;", "ERR_ARGVALERR"),
        ("PackRawBytes 1, rb, 1025 \\IntX:=USINT;", "ERR_ARGVALERR"),
        ("PackRawBytes 256, rb, 1 \\IntX:=USINT;", "ERR_ARGVALERR"),
        ("WaitUntil n = 1 \\PollRate:=0.01;", "ERR_ARGVALERR"),
        ("PackRawBytes 1.5, rb, 1 \\IntX:=USINT;", "ERR_INT_NOTVAL"),
    ],
)
def test_the_limits_of_a_controller(body: str, error: str) -> None:
    data = "VAR string s;\nVAR num n;\nVAR num list{3};\nVAR rawbytes rb;"
    with pytest.raises(ProgramStopped, match=error):
        ran(body, data)


AROUND_OBEY = """VAR errnum CELL_ERR_ABORT := -1;
VAR intnum cell_abort_intno;
VAR intnum cell_watch_intno;
VAR bool cell_wanted := TRUE;
VAR bool cell_abort;
VAR bool cell_serves;
VAR bool fails := {fails};
VAR num moves;
VAR num seen;
---
{obey}
PROC cell_enter()
ENDPROC
PROC cell_leave()
ENDPROC
PROC cell_settle()
ENDPROC
PROC cell_moves(bool stays)
  VAR num zero;
  moves := moves + 1;
  cell_wanted := moves < 3;
  IF moves = 1 RAISE CELL_ERR_ABORT;
  IF fails seen := 1 / zero;
ERROR
  RAISE;
ENDPROC
"""
OTHER_ERROR_IN_MAIN = "IF ERRNO = ERR_DIVZERO seen := 5;\nTRYNEXT;"


@pytest.fixture(params=["takes what it lists", "takes every error"])
def listed_clause(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """No manual says which of both `ERROR (number)` does with an error that is raised out of a call."""
    if request.param == "takes every error":
        monkeypatch.setattr(statements, "_lists", lambda *_: True)
    return str(request.param)


def around_obey(fails: str) -> str:
    shipped = re.search(r"PROC cell_obey\(.*?ENDPROC", (DEPLOYED / "CELL_motion.mod").read_text(), re.DOTALL)
    assert shipped
    return AROUND_OBEY.format(fails=fails, obey=shipped[0])


@pytest.mark.usefixtures("listed_clause")
def test_obeying_goes_on_after_an_abort() -> None:
    snippet = ran("cell_obey FALSE;", around_obey("FALSE"), OTHER_ERROR_IN_MAIN)
    assert (snippet["moves"], snippet["seen"]) == (3, 0)


def test_obeying_ends_at_any_other_error(listed_clause: str) -> None:
    snippet = Snippet(module("cell_obey FALSE;", around_obey("TRUE"), OTHER_ERROR_IN_MAIN))
    if listed_clause == "takes every error":
        assert snippet.runs()["seen"] == 5
    else:
        with pytest.raises(ProgramStopped, match="cell_obey has no ERROR handler"):
            snippet.runs()
    assert snippet["moves"] == 2
