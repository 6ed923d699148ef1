"""What public programs use and the shipped modules do not: parts of the language, names, dialogues, displacements."""

from pathlib import Path

import numpy as np
import pytest

from mock_robot.rapid.errors import ProgramStopped, RapidProgramError
from mock_robot.rapid.home import load_module
from mock_robot.rapid.messages import Meetings
from tests.mock_robot.rapid.snippets import ran, value_of

DATA = "VAR num n := 7;\nVAR string s;\nVAR dir folder;\nVAR errnum broke;"
POINTS = f"{DATA}\nVAR pos q := [1, 2, 3];\nVAR pos p;"
TOTAL = f"{DATA}\n---\nFUNC num total(num list{{*}})\nRETURN list{{1}} + list{{3}};\nENDFUNC"
NESTED = f"RECORD outer\ninside inner;\nENDRECORD\nRECORD inside\nnum a;\nENDRECORD\n{DATA}\nVAR outer o;"
BACKWARD = f"{DATA}\n---\nPROC there()\nn := 3;\nBACKWARD\nn := 4;\nENDPROC"
KEYS = 'TPReadFK n, "go on?", "yes", "no", "", "", "" \\MaxTime:=0 \\BreakFlag:=broke;'
BOX = 'n := UIMessageBox(\\MsgArray:=["b", "c"] \\Buttons:=btnYesNo \\MaxTime:=0 \\BreakFlag:=broke);'
LISTING = 'OpenDir folder, "HOME:";\nn := 0;\nWHILE ReadDir(folder, s) DO\nn := n + 1;\nENDWHILE\nCloseDir folder;'


@pytest.mark.parametrize(
    ("body", "around", "n"),
    [
        ("TEST n\nDEFAULT:\nn := 8;\nENDTEST", DATA, 8),
        ("n := total([1, 2, 4]);", TOTAL, 5),
        ("n := p.y;", f"{POINTS}\n---\nLOCAL PROC none()\nENDPROC", 0),
        ("p := [10, 20, 30] + q;\nn := p.y;", POINTS, 22),
        ("n := o.inner.a;", NESTED, 0),
        ("there;", BACKWARD, 3),
        ('SetDataVal "n", 12;\nGetDataVal "n", n;\nn := n + 1;', DATA, 13),
        (f"{KEYS}\nIF broke = ERR_TP_MAXTIME n := 1;", DATA, 1),
        (BOX, DATA, 0),
        (LISTING, DATA, 2),
        ("n := 0;\nIF BitCheckDnum(5, 3) n := 1;", DATA, 1),
    ],
)
def test_parts_of_the_language(body: str, around: str, n: float) -> None:
    assert ran(body, around)["n"] == n


def test_a_dialogue_that_nobody_answers_is_an_error_one_can_handle() -> None:
    handler = "IF ERRNO = ERR_TP_MAXTIME THEN\nn := 2;\nTRYNEXT;\nENDIF\nRAISE;"
    assert ran('TPReadNum n, "how many?" \\MaxTime:=0;', DATA, handler)["n"] == 2


def test_a_frame_of_three_points() -> None:
    points = "".join(
        f"CONST robtarget {name} := [{place}, [1, 0, 0, 0], [0, 0, 0, 0], [9E9, 9E9, 9E9, 9E9, 9E9, 9E9]];\n"
        for name, place in (("a", "[1, 1, 0]"), ("b", "[1, 3, 0]"), ("c", "[0, 2, 0]"), ("d", "[1, 5, 0]"))
    )
    frame = value_of("DefFrame(a, b, c)", "pose", points)
    np.testing.assert_allclose(frame[0], [1, 1, 0])
    np.testing.assert_allclose(frame[1], [np.sqrt(0.5), 0, 0, np.sqrt(0.5)], atol=1e-6)
    np.testing.assert_allclose(value_of("DefFrame(a, b, c \\Origin:=3)", "pose", points)[0], [1, 2, 0])
    with pytest.raises(ProgramStopped, match="on a line"):
        value_of("DefFrame(a, b, d)", "pose", points)


def test_tasks_wait_for_each_other_again_and_again() -> None:
    meetings, names = Meetings(), frozenset({"t_rob1", "t_comm"})
    for _ in range(2):
        first = meetings.enter(names, "t_rob1")
        assert not first()
        second = meetings.enter(names, "t_comm")
        assert first()
        assert second()
    late = meetings.enter(names, "t_rob1")
    meetings.leave(names, "t_rob1")
    meetings.enter(names, "t_comm")
    assert not late(), "who has left is not waited for, and not met"


def test_a_task_that_waits_in_vain_for_another_hears_of_it() -> None:
    data = 'VAR syncident here;\nPERS tasks both{2} := [["T_TEST"], ["T_OTHER"]];\nVAR num n;'
    assert ran("WaitSyncTask here, both \\TimeOut:=0;\nn := 5;", data, "n := 1;\nTRYNEXT;")["n"] == 5


def test_an_encoded_module_is_named_as_one(tmp_path: Path) -> None:
    path = tmp_path / "secret.mod"
    path.write_bytes(b"MODULE secret(NOVIEW)\r\n" + bytes(range(1, 256)) * 3)
    with pytest.raises(RapidProgramError, match="is encoded"):
        load_module(path)
