"""The language: what a statement does, by small programs."""

import math
import struct
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mock_robot.rapid.errors import ProgramStopped, RapidProgramError
from mock_robot.rapid.program import PersistentMemory
from mock_robot.rapid.scope import Data
from tests.mock_robot.rapid.snippets import Snippet, module, ran, value_of


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("1 + 2 * 3", 7),
        ("(1 + 2) * 3", 9),
        ("7 DIV 2", 3),
        ("-7 DIV 2", -3),
        ("-7 MOD 2", -1),
        ("2 - 3 - 4", -5),
        ("0.1", float(np.float32(0.1))),
        ("0.1 + 0.2", float(np.float32(np.float32(0.1) + np.float32(0.2)))),
        ("16777216 + 1", 16777216),
        ("9E9", 8999999488.0),
        ("-(2 + 3)", -5),
        ("Abs(-2.5)", 2.5),
        ("Trunc(2.567 \\Dec:=1)", float(np.float32(2.5))),
        ("Sqrt(2)", float(np.float32(math.sqrt(2)))),
        ('StrLen("a""b\\\\c\\41")', 6),
    ],
)
def test_numbers(expression: str, value: float) -> None:
    assert value_of(expression) == value


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("1 < 2 AND 2 < 3", True),
        ("1 < 2 AND NOT 2 < 3", False),
        ("FALSE OR TRUE", True),
        ("TRUE XOR TRUE", False),
        ('"ab" + "c" = "abc"', True),
        ("a = b", True),
        ("a.x <> b.x", False),
    ],
)
def test_truths(expression: str, value: bool) -> None:
    assert value_of(expression, "bool", "VAR pos a := [1, 2, 3];\nCONST pos b := [1, 2, 3];") is value


def test_records_are_values_and_their_parts_can_be_written_and_passed() -> None:
    snippet = ran(
        "a := b;\na.trans.x := 9;\nAdd a.trans.y;\nlist{2} := a.trans.x;\nAdd list{3};\nn := list{2} + list{3};",
        """VAR pose a;
        VAR pose b := [[1, 2, 3], [1, 0, 0, 0]];
        VAR num list{3} := [1, 2, 3];
        VAR num n;
        ---
        PROC Add(INOUT num x)
          x := x + 10;
        ENDPROC""",
    )
    assert snippet["a"] == [[9, 12, 3], [1, 0, 0, 0]]
    assert snippet["b"] == [[1, 2, 3], [1, 0, 0, 0]]
    assert snippet["n"] == 22


def test_an_argument_by_value_is_a_copy() -> None:
    around = "VAR pos p := [1, 2, 3];\n---\nPROC Spoil(pos q)\nq.x := 7;\nENDPROC"
    assert ran("Spoil p;", around)["p"] == [1, 2, 3]


def test_optional_arguments_and_switches_are_there_or_not() -> None:
    around = """VAR num n;
    ---
    PROC Count(num first \\num second \\switch twice)
      IF Present(first) n := n + first;
      IF Present(second) n := n + second;
      IF Present(twice) n := 2 * n;
    ENDPROC"""
    assert ran("Count 1;", around)["n"] == 1
    assert ran("Count 1 \\second:=2;", around)["n"] == 3
    assert ran("Count 1 \\second:=2 \\twice;", around)["n"] == 6


def test_loops_and_choices() -> None:
    body = """FOR i FROM 1 TO 4 DO
      IF i = 2 THEN
        n := n + 10;
      ELSEIF i = 3 THEN
        n := n + 100;
      ELSE
        n := n + 1;
      ENDIF
    ENDFOR
    FOR i FROM 3 TO 1 STEP -2 DO
      n := n + 1000 * i;
    ENDFOR
    WHILE n > 4000 DO
      n := n - 4000;
    ENDWHILE
    TEST n
    CASE 1, 2:
      n := -1;
    CASE 112:
      n := n + 0.5;
    DEFAULT:
      n := -2;
    ENDTEST"""
    assert ran(body, "VAR num n;")["n"] == 112.5


def test_functions_return_and_recursion_has_a_frame_of_its_own() -> None:
    around = """VAR num n;
    ---
    FUNC num Factorial(num of)
      VAR num smaller;
      IF of <= 1 RETURN 1;
      smaller := Factorial(of - 1);
      RETURN of * smaller;
    ENDFUNC"""
    assert ran("n := Factorial(6);", around)["n"] == 720


TABLE = "CONST num table{2, 3} := [[1, 2, 3], [4, 5, 6]];"
TOTAL = """FUNC num total(num values{*,*})
  VAR num sum;
  FOR row FROM 1 TO 2 DO
    FOR column FROM 1 TO 3 DO
      sum := sum + values{row, column};
    ENDFOR
  ENDFOR
  RETURN sum;
ENDFUNC"""
NESTED = "RECORD outer\ninside inner;\nENDRECORD\nRECORD inside\nnum a;\nENDRECORD\nVAR outer o;"


@pytest.mark.parametrize(
    ("body", "data", "routines", "n"),
    [
        ("TEST n\nDEFAULT:\nn := 8;\nENDTEST", "", "", 8),
        ("n := total(table);", TABLE, TOTAL, 21),
        ("n := total([[1, 2, 3], [0, 0, 4]]);", "", TOTAL, 10),
        ("p := [10, 20, 30] + q;\nn := p.y;", "VAR pos q := [1, 2, 3];\nVAR pos p;", "", 22),
        ("n := o.inner.a;", NESTED, "", 0),
        ("n := 1;\nagain:\nn := 2 * n;\nIF n < 10 GOTO again;", "", "", 16),
    ],
)
def test_parts_that_the_shipped_modules_do_not_use(body: str, data: str, routines: str, n: float) -> None:
    assert ran(body, f"{data}\nVAR num n := 7;\n---\n{routines}")["n"] == n


# --- PERS ---


def test_a_pers_keeps_its_value_over_a_restart_and_is_shared_by_name() -> None:
    memory = PersistentMemory()
    text = module("n := n + 1;\nm := m + 1;", "PERS num n := 5;\nVAR num m := 5;")
    for expected in (6, 7, 8):
        snippet = Snippet(text, memory).runs()
        assert (snippet["n"], snippet["m"]) == (expected, 6)
    assert Snippet(module("n := n * 2;", "PERS num n := 0;"), memory).runs()["n"] == 16


def test_a_private_pers_belongs_to_its_task() -> None:
    memory = PersistentMemory()
    Snippet(module("n := 9;", "TASK PERS num n := 5;"), memory).runs()
    assert Snippet(module("m := n;", "PERS num n := 1;\nVAR num m;"), memory).runs()["m"] == 1


# --- interrupts ---

TRAPPED = """PERS num bell := 0;
VAR intnum number;
VAR num rung;
VAR num n;
---
TRAP on_bell
  rung := rung + 1;
  bell := 5;
ENDTRAP
"""


def test_a_trap_runs_before_the_next_instruction_when_its_pers_changes_and_not_inside_itself() -> None:
    body = "CONNECT number WITH on_bell;\nIPers bell, number;\nbell := 0;\nn := rung;\nbell := 1;\nn := n + 10 * rung;"
    snippet = ran(body + "\nIDelete number;\nbell := 7;\nn := n + 1000 * (rung - 2);", TRAPPED)
    assert snippet["n"] == 20, "once for the change, and once more for the change inside the trap, afterwards"


def test_an_interrupt_that_comes_while_the_task_is_stopped_is_lost() -> None:
    snippet = Snippet(module("CONNECT number WITH on_bell;\nIPers bell, number;", TRAPPED)).runs()
    snippet.task.running = False
    snippet.memory["bell"].value = 3.0
    snippet.task.running = True
    snippet.task.attend()
    assert snippet["rung"] == 0
    snippet.memory["bell"].value = 4.0
    snippet.task.attend()
    assert snippet["rung"] == 2, "for this change, and for the one the trap makes"


def test_an_interrupt_that_was_deleted_calls_nothing_any_more() -> None:
    snippet = Snippet(module("CONNECT number WITH on_bell;\nIPers bell, number;", TRAPPED)).runs()
    snippet.memory["bell"].value = 4.0
    order = snippet.program.scope.find("number")
    assert isinstance(order, Data)
    assert order.slot is not None
    snippet.task.services.interrupts.delete(order.slot)
    snippet.task.attend()
    assert snippet["rung"] == 0


def test_connecting_twice_is_an_error() -> None:
    with pytest.raises(ProgramStopped, match="ERR_ALRDYCNT"):
        ran("CONNECT number WITH on_bell;\nCONNECT number WITH on_bell;", TRAPPED)


def test_an_error_raised_out_of_a_trap_stops_the_program() -> None:
    around = TRAPPED.replace("bell := 5;", "n := 1 / n;\nERROR\nRAISE;")
    body = "CONNECT number WITH on_bell;\nIPers bell, number;\nbell := 1;\nn := 1;"
    with pytest.raises(ProgramStopped, match="out of a TRAP"):
        ran(body, around, "TRYNEXT;")


# --- before it starts ---


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("Jump 1;", "no instruction or procedure is named Jump"),
        ("n := Guess(1);", "no function is named Guess"),
        ("m := 1;", "no data is named m"),
        ("n := TRUE;", "num is wanted here, this is bool"),
        ("n := p.w;", "pos has no component w"),
        ("WaitTime 1 \\Quick;", "waittime has no argument .quick"),
        ("WaitTime;", "waittime takes 1 arguments"),
        ("c := 2;", "c is CONST"),
        ("IF n n := 1;", "bool is wanted"),
        ("p := [1, 2];", "pos has 3 parts"),
        ("rb := other;", "rawbytes has no value to assign"),
        ("ClkReset n;", "wants clock"),
        ("ClkReset 1;", "a data object is wanted"),
        ("MoveJ t, v100, fine, own;", "wants PERS, own is VAR"),
        ('SocketSend s \\Str:="a" \\RawData:=rb;', "takes one of"),
        ("CONNECT n WITH nothing;", "no TRAP is named nothing"),
        ("TRYNEXT;", "TRYNEXT belongs into an ERROR handler"),
        ("RETURN 5;", "has no value"),
        ('n := 1 + "a";', "num . string is nothing"),
        ('text := "' + 81 * "x" + '";', "a string holds 80"),
    ],
)
def test_what_no_controller_would_start_names_file_and_line(line: str, why: str) -> None:
    data = "VAR num n;\nCONST num c := 1;\nVAR pos p;\nVAR rawbytes rb;\nVAR rawbytes other;\nVAR string text;"
    data += "\nVAR robtarget t;\nVAR tooldata own;\nVAR socketdev s;\n\n\n\n"
    with pytest.raises(RapidProgramError, match=why) as refused:
        Snippet(module(line, data))
    assert (refused.value.module, refused.value.line) == ("TEST.mod", 17)


@pytest.mark.parametrize(
    ("data", "why"),
    [
        ("VAR num step;", "step is a reserved word"),
        ("VAR num error;", "error is a reserved word"),
        (f"VAR num {'a' * 33};", "longer than 32"),
        ("VAR num n{2, 2, 2, 2};", "an array at most three"),
        ("VAR num n := Abs(1);", "not of constants: abs"),
        ("VAR num m;\nVAR num n := m;", "not of constants: m"),
        ("PERS socketdev s;", "which can be VAR only"),
    ],
)
def test_what_no_controller_declares_is_refused(data: str, why: str) -> None:
    with pytest.raises(RapidProgramError, match=why):
        Snippet(module("", data))


def test_what_a_controller_declares_is_taken() -> None:
    data = f"CONST num c := 2;\nCONST num d := 2 * c;\nVAR num n{{2, c, 2}};\nVAR num {'a' * 32} := d + pi;"
    Snippet(module("StopMove \\Quick \\AllMotionTasks;\nn{1, 2, 1} := 1;", data))


def test_an_error_is_not_raised_by_number_in_a_handler() -> None:
    with pytest.raises(RapidProgramError, match="RAISE with a number does not belong"):
        Snippet(module("WaitTime 0;\nERROR\nRAISE ERR_DIVZERO;"))


@pytest.mark.parametrize(
    "body",
    [
        "GOTO inside;\nWHILE n < 3 DO\ninside:\nn := n + 1;\nENDWHILE",
        "GOTO inside;\nFOR i FROM 1 TO 3 DO\ninside:\nn := i;\nENDFOR",
        "IF n = 1 THEN\nGOTO inside;\nELSE\ninside:\nn := 2;\nENDIF",
        "GOTO nowhere;",
    ],
)
def test_goto_leads_neither_into_a_loop_or_branch_nor_nowhere(body: str) -> None:
    with pytest.raises(RapidProgramError, match="no such label in this block"):
        Snippet(module(body, "VAR num n;"))


def test_goto_leads_out_of_a_loop() -> None:
    body = "WHILE TRUE DO\nn := n + 1;\nIF n > 4 GOTO done;\nENDWHILE\ndone:\nn := 10 * n;"
    assert ran(body, "VAR num n;")["n"] == 50


def test_names_differ_by_more_than_case() -> None:
    with pytest.raises(RapidProgramError, match="busy is declared twice"):
        Snippet(module("", "VAR num busy;\nCONST num BUSY := 1;"))


# --- properties ---

NUMS = st.floats(-1e6, 1e6, width=32).map(lambda value: value + 0.0)


@settings(deadline=None)
@given(NUMS, NUMS, NUMS)
def test_arithmetic_is_that_of_ieee_single(a: float, b: float, c: float) -> None:
    snippet = _arithmetic()
    for name, value in zip("abc", (a, b, c), strict=True):
        snippet.memory[name].value = value
    snippet.runs()
    f = np.float32
    with np.errstate(all="ignore"):
        assert snippet["plain"] == float(f(a) + f(b) * f(c) - f(a))
        assert snippet["nested"] == float((f(a) - f(b)) * (f(b) + f(c)))
        if f(abs(c)) > f(0.001):
            assert snippet["ratio"] == float(f(a) / f(c))


@cache
def _arithmetic() -> Snippet:
    body = "plain := a + b * c - a;\nnested := (a - b) * (b + c);\nIF Abs(c) > 0.001 ratio := a / c;"
    data = "\n".join(f"PERS num {name} := 0;" for name in "abc")
    return Snippet(module(body, data + "\nVAR num plain;\nVAR num nested;\nVAR num ratio;"))


LAYOUTS = {"USINT": "B", "UINT": "H", "UDINT": "I", "SINT": "b", "INT": "h", "DINT": "i"}


@settings(deadline=None)
@given(
    st.lists(
        st.one_of(
            st.tuples(st.just("USINT"), st.integers(0, 255)),
            st.tuples(st.just("SINT"), st.integers(-128, 127)),
            st.tuples(st.just("UINT"), st.integers(0, 65535)),
            st.tuples(st.just("INT"), st.integers(-32768, 32767)),
            st.tuples(st.just("UDINT"), st.integers(0, 8388608)),
            st.tuples(st.just("DINT"), st.integers(-8388607, 8388608)),
            st.tuples(st.just("Float4"), NUMS),
        ),
        min_size=1,
        max_size=12,
    ),
    st.integers(1, 900),
    st.booleans(),
)
def test_rawbytes_are_those_of_struct(fields: list[tuple[str, float]], start: int, network: bool) -> None:
    order = "\\Network" if network else ""
    lines, position, layout = [], start, ">" if network else "<"
    for number, (kind, value) in enumerate(fields):
        how = "\\Float4" if kind == "Float4" else f"\\IntX:={kind}"
        lines.append(f"values{{{number + 1}}} := {_literal(value)};")
        lines.append(f"PackRawBytes values{{{number + 1}}}, rb {order}, {position} {how};")
        lines.append(f"UnpackRawBytes rb {order}, {position}, back{{{number + 1}}} {how};")
        letter = "f" if kind == "Float4" else LAYOUTS[kind]
        position, layout = position + struct.calcsize(letter), layout + letter
    snippet = ran(
        "\n".join(lines), f"VAR rawbytes rb;\nVAR num values{{{len(fields)}}};\nVAR num back{{{len(fields)}}};"
    )
    expected = struct.pack(layout, *(value for _, value in fields))
    assert snippet["rb"].read(start, len(expected)) == expected
    assert snippet["rb"].length == start - 1 + len(expected)
    assert snippet["back"] == snippet["values"] == [value for _, value in fields]


def _literal(value: float) -> str:
    if value == 0:
        return "0"  # RAPID has no literal for -0
    text = f"{abs(value):.17g}" if isinstance(value, float) else str(abs(value))
    return f"-{text}" if value < 0 else text
