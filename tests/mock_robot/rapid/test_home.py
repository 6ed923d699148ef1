"""Any controller's HOME: tasks, modules and signals found, run, and what is not known named by file and line."""

import json
import socket
from pathlib import Path

import pytest

from mock_robot.__main__ import main
from mock_robot.errors import MockError
from mock_robot.rapid.home import HomeFragments, load_problems
from tests.mock_robot.rws_cell import rws_cell_apart
from tests.support.ports import free_port
from tests.support.waiting import LIMIT_S

SERVER = """%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%
MODULE server
  LOCAL RECORD counted num of; ENDRECORD
  VAR socketdev listening;
  VAR socketdev client;
  VAR counted count;
  VAR string text;
  VAR robtarget here;
  PERS num served := 0;
  PROC main()
    SocketCreate listening;
    SocketBind listening, "127.0.0.1", {port};
    SocketListen listening;
    SocketAccept listening, client \\Time:=9999999;
    again:
    SocketReceive client \\Str:=text \\Time:=9999999;
    served := served + 1;
    here := CRobT(\\TaskName:="T_ROB1" \\Tool:=tool0 \\WObj:=wobj0);
    SocketSend client \\Str:=NumToStr(here.trans.z, 3);
    SetDO do_served, 1;
    IF served < 2 GOTO again;
    SocketClose client;
    WaitTime 1000;
  ERROR
    RAISE;
  ENDPROC
ENDMODULE
"""
SYS = """SYS:CFG_1.0:6:0::
#
CAB_TASK_MODULES:

      -File "HOME:/prog/server.mod" -ModName "server" -Task "T_SRV"
#
CAB_TASKS:

      -Name "T_SRV" -Type "SEMISTATIC"
"""
EIO = """EIO:CFG_1.0:6:1::
#
EIO_SIGNAL:

      -Name "do_served" -SignalType "DO" -Device "Virt1"\\
      -DeviceMap "1"
"""


def write_home(folder: Path, port: int, text: str = SERVER) -> Path:
    (folder / "prog").mkdir()
    (folder / "SYSPAR").mkdir()
    (folder / "prog" / "server.mod").write_text(text.replace("{port}", str(port)))
    (folder / "SYSPAR" / "SYS.cfg").write_text(SYS)
    (folder / "SYSPAR" / "EIO.cfg").write_text(EIO)
    return folder


def test_a_foreign_program_runs_beside_its_own_client(tmp_path: Path) -> None:
    port = free_port()
    with rws_cell_apart(home=write_home(tmp_path, port)) as cell:
        with socket.create_connection(("127.0.0.1", port), LIMIT_S) as client:
            client.settimeout(LIMIT_S)
            heights = []
            for _ in range(2):
                client.sendall(b"where")
                heights.append(float(client.recv(100)))
        assert heights[0] == heights[1]
        symbol = cell.controller.symbol("t_srv", "server", "served")
        assert symbol is not None
        assert symbol.value == "2"


def test_its_tasks_modules_and_signals_are_shown_and_those_that_all_may_write_are_set(tmp_path: Path) -> None:
    home = write_home(tmp_path, free_port())
    eio = home / "SYSPAR" / "EIO.cfg"
    eio.write_text(EIO + '\n      -Name "mode" -SignalType "AO" -Access "All" -Device "DRV_1"\n')
    with rws_cell_apart(home=home) as cell, cell.client_1() as client:
        tasks = client.get("/rw/rapid/tasks?json=1").json()["_embedded"]["_state"]
        assert ("T_SRV", "semistatic") in [(task["name"], task["type"]) for task in tasks]
        modules = client.get("/rw/rapid/modules?task=T_SRV&json=1").json()["_embedded"]["_state"]
        assert "server" in [module["name"] for module in modules]
        rows = (("Local/DRV_1/mode", 204), ("Local/Virt1/do_served", 403), ("Local/DRV_1/do_served", 404))
        for signal, status in rows:
            answer = client.post(f"/rw/iosystem/signals/{signal}?action=set", data={"lvalue": "1.5"})
            assert answer.status_code == status
        shown = client.get("/rw/iosystem/signals/Local/DRV_1/mode?json=1").json()["_embedded"]["_state"][0]
        assert (shown["type"], shown["lvalue"]) == ("AO", "1.5")


def test_tasks_and_signals_are_those_of_the_configuration(tmp_path: Path) -> None:
    home = HomeFragments(write_home(tmp_path, 1), 6)
    assert [(plan.name, plan.kind, [source.name for source in plan.sources]) for plan in home.task_plans()] == [
        ("T_SRV", "SEMISTATIC", ["server.mod"])
    ]
    assert home.signals().keys() == {"do_served"}


@pytest.mark.parametrize(
    ("statement", "words"),
    [
        ("NoSuchThing 1;", "no instruction or procedure is named NoSuchThing"),
        ("MoveL p, v100 \\Wrong:=1, fine, tool0;", "wrong"),
        ("a := Unheard(1);", "Unheard"),
        ("IF", "server.mod"),
    ],
)
def test_what_is_not_known_is_named_at_load(tmp_path: Path, statement: str, words: str) -> None:
    text = SERVER.replace("WaitTime 1000;", f"WaitTime 1;\n{statement}")
    home = write_home(tmp_path, 1, text.replace("VAR string", "VAR num a; VAR robtarget p; VAR string"))
    count, problems = load_problems(home)
    assert (count, [problem.file for problem in problems]) == (1, ["prog/server.mod"])
    assert words.lower() in problems[0].what.lower()


def test_a_home_that_does_not_load_is_refused_with_its_files(tmp_path: Path) -> None:
    home = write_home(tmp_path, 1, SERVER.replace("SetDO do_served", "Untold do_served"))
    with pytest.raises(MockError, match=r"1 of 1 modules do not load: prog/server\.mod"), rws_cell_apart(home=home):
        pass


def test_a_backup_has_its_modules_in_the_folders_of_its_tasks(tmp_path: Path) -> None:
    folder = tmp_path / "RAPID" / "TASK1" / "PROGMOD"
    folder.mkdir(parents=True)
    (folder / "mine.mod").write_text("MODULE mine\nPROC main()\nENDPROC\nENDMODULE\n")
    (plan,) = HomeFragments(tmp_path, 6).task_plans()
    assert (plan.name, plan.motion, [source.name for source in plan.sources]) == ("T_ROB1", True, ["mine.mod"])


def test_an_encoded_module_is_named_as_one(tmp_path: Path) -> None:
    (tmp_path / "secret.mod").write_bytes(b"MODULE secret(NOVIEW)\r\n" + bytes(range(1, 256)) * 3)
    (problem,) = load_problems(tmp_path)[1]
    assert "is encoded" in problem.what


def test_the_command_counts_what_loads(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_home(tmp_path, 1)
    (tmp_path / "bad.mod").write_text("MODULE bad\nPROC main()\nUnheard;\nENDPROC\nENDMODULE\n")
    assert main(["load", str(tmp_path), "--json"]) == 1
    report = json.loads(capsys.readouterr().out)
    assert (report["modules"], [problem["file"] for problem in report["problems"]]) == (2, ["bad.mod"])
