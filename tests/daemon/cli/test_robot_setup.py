"""`handeyed robot setup` at the mock: what a controller lacks is said before a write; then all is done, and undone."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from calibration.transforms import transform
from daemon.cli.main import app
from mock_robot.cabinet.panel import Mode
from mock_robot.rws.context import RequestContext
from mock_robot.rws.exchange import DONE, Item, Reply
from mock_robot.rws.routes import answer_request
from protocols.cfg_file import CfgInstance, parse_cfg
from tests.daemon.cli.running import Ran, handeyed
from tests.mock_robot.rws_cell import RwsCell, rws_cell_apart

State = Callable[[RwsCell], Any]


def run(cell: RwsCell, version: int, *options: str | Path) -> Ran:
    return handeyed("robot", "setup", cell.rws(version), *options)


def of_home(cell: RwsCell) -> dict[str, bytes]:
    return {path: content for path, content in cell.world.volumes.files.items() if path.startswith("HOME/")}


def bare(cell: RwsCell) -> None:
    """A controller as it is delivered."""
    cell.world.remove_robot_program()


def without(*options: str) -> State:
    return lambda cell: setattr(cell.world.equipment, "without", frozenset(options))


def denied(*grants: str) -> State:
    return lambda cell: setattr(cell.world.equipment, "denied", frozenset(grants))


def manual(cell: RwsCell) -> None:
    cell.controller.switch_mode(Mode.MANR, cell.cell.clock())


def virtual(cell: RwsCell) -> None:
    cell.world.equipment = replace(cell.world.equipment, virtual=True)


def upside_down(cell: RwsCell) -> None:
    cell.world.cabinet.mounting.world_T_base = transform(np.diag([1.0, -1.0, -1.0]), [0.0, 0.0, 2500.0])


def configured(text: str) -> State:
    """The controller's configuration has these instances in place of its own of the type."""
    file = parse_cfg(text)

    def state(cell: RwsCell) -> None:
        types = dict(cell.world.equipment.configuration.get(file.domain, {}))
        types |= {each.kind: {} for each in file.instances}
        for each in file.instances:
            types[each.kind][each.name] = each
        have = {**cell.world.equipment.configuration, file.domain: types}
        cell.world.equipment = replace(cell.world.equipment, configuration=have)

    return state


NO_DOOR = 'SIO:CFG_1.0::\nFIREWALL_MANAGEMENT:\n -Name "{}" -EnableOnPublicNet "false" -EnableOnPrivateNet "true"\n'
OTHER_LOADS = 'SYS:CFG_1.0::\nSYS_MISC:\n -Name "ModalPayLoadMode" -Value "0"\n'


def held(cell: RwsCell) -> None:
    cell.cell.inject_fault("rws-mastership-held")


FINDINGS: list[tuple[int, State, str, bool, str]] = [
    (1, without("623-1"), "multitasking", True, "623-1 Multitasking"),
    (2, without("3114-1"), "multitasking", True, "3114-1 Multitasking"),
    (2, without("3114-1"), "multitasking", True, "pendant, Settings, System, Options"),
    (1, without("616-1"), "pc-interface", True, "616-1 PC Interface"),
    (1, without("616-1"), "pc-interface", True, "pendant, System Info, System properties, Options"),
    (1, denied("UAS_FTP_WRITE"), "grant-files", True, "Groups"),
    (2, denied("UAS_FILE_ACCESS_READ_WRITE"), "grant-files", True, "Roles"),
    (2, denied("UAS_CFG_WRITE"), "grant-configuration", False, "Modify configuration"),
    (1, denied("UAS_RAPID_CURRVALUE"), "grant-data", False, "Reset RAPID"),
    (2, denied("UAS_REMOTE_START_STOP_IN_AUTO"), "grant-remote-stop", False, "Remote Start and Stop in Auto"),
    (1, manual, "manual-mode", False, "switch to AUTO"),
    (2, held, "mastership", False, "Release Write Access"),
    (2, virtual, "virtual", False, "127.0.0.1"),
    (1, upside_down, "base-frame", False, "[0, 0, 2500, 0, 1, 0, 0]"),
    (1, bare, "tool-load", False, "LoadIdentify"),
    (1, denied("UAS_BACKUP"), "grant-backup", True, "Backup and save"),
    (2, denied("UAS_SYSTEM_ADMINISTRATION"), "grant-restart", False, "Reset RAPID is done by somebody who has it"),
    (2, configured(NO_DOOR.format("RapidSockets")), "firewall", False, "RapidSockets, EnableOnPublicNet Yes"),
    (1, configured(OTHER_LOADS), "payload-mode", True, "ModalPayLoadMode 1"),
    (2, configured(OTHER_LOADS), "payload-mode", True, "GripLoad"),
    (2, bare, "address", False, "127.0.0.1 (X23, Public): set-up lets the link listen there"),
]


@pytest.fixture(scope="module")
def shared_cell() -> Any:
    with rws_cell_apart() as cell:
        yield cell


@pytest.mark.parametrize(
    ("version", "state", "code", "missing", "words"), FINDINGS, ids=[f"{row[2]}-{row[4][:24]}" for row in FINDINGS]
)
def test_what_a_controller_lacks_is_said_before_anything_is_changed(
    shared_cell: RwsCell, version: int, state: State, code: str, missing: bool, words: str
) -> None:
    cell, before = shared_cell, replace(shared_cell.world.equipment)
    cell.does(lambda: state(cell))
    try:
        ran = run(cell, version, "--dry-run", "--json")
        found = {each["code"]: each for each in json.loads(ran.out)["findings"]}
        assert words in found[code]["what"] + found[code]["fix"]
        assert found[code]["missing"] is missing
        assert ran.status == (1 if missing else 0)
        assert not cell.world.volumes.files
    finally:
        cell.world.equipment = before
        cell.does(cell.cell.clear_faults)
        cell.does(lambda: cell.controller.recover(cell.cell.clock()))


@pytest.mark.parametrize(("door", "options", "shown"), [("UDPUC", (), False), ("UDPUC", ("--egm", "10.0.0.9"), True)])
def test_a_closed_door_is_said_when_it_is_needed(
    shared_cell: RwsCell, door: str, options: tuple[str, ...], shown: bool
) -> None:
    before = shared_cell.world.equipment
    configured(NO_DOOR.format(door))(shared_cell)
    try:
        steps = [line for line in run(shared_cell, 2, "--dry-run", *options).out.splitlines() if "by hand" in line]
        assert any("Firewall Manager: UDPUC" in step for step in steps) is shown
    finally:
        shared_cell.world.equipment = before


def test_egm_is_asked_for_only_when_it_is_wanted(shared_cell: RwsCell) -> None:
    without("689-1")(shared_cell)
    try:
        assert run(shared_cell, 1, "--dry-run").status == 0
        assert "689-1 Externally Guided Motion" in run(shared_cell, 1, "--dry-run", "--egm", "10.0.0.9").out
    finally:
        without()(shared_cell)


def test_a_task_of_the_same_name_that_is_not_ours_is_said_and_nothing_is_changed() -> None:
    """As on the GoFa whose answers are public: its T_COMM is a task of its own."""
    with rws_cell_apart() as cell:
        cell.does(lambda: bare(cell))
        theirs = '-Name "T_COMM" -Type "NORMAL" -Entry "comm" -TrustLevel "SysFail"'
        configured(f"SYS:CFG_1.0::\nCAB_TASKS:\n {theirs}\n")(cell)
        ran = run(cell, 2, "--yes", "--link-task", "T_COMM")
        assert ran.status == 1
        assert "MISSING the controller has another T_COMM in SYS/CAB_TASKS: Name T_COMM, Type NORMAL" in ran.out
        assert "--link-task" in ran.out
        assert not cell.world.volumes.files
        assert run(cell, 2, "--dry-run").status == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ((), ("--called",), "still names HOME:/handeyed/CELL_main.mod"),
        (("--called",), (), "the controller has SYS.cfg in part: CELL_main is not there"),
        (("--egm", "10.0.0.9"), ("--egm", "10.0.0.8"), "another handeyed in SIO/UDPUC_HOST"),
    ],
)
def test_another_choice_than_that_of_the_set_up_before_is_noticed(
    before: tuple[str, ...], after: tuple[str, ...], words: str, tmp_path: Path
) -> None:
    with rws_cell_apart() as cell:
        cell.does(lambda: bare(cell))
        assert run(cell, 2, "--yes", "--backup", tmp_path, *before).status == 0
        files = dict(cell.world.volumes.files)
        ran = run(cell, 2, "--yes", "--backup", tmp_path, *after)
        assert ran.status == 1
        assert words in ran.out
        assert "robot remove" in ran.out
        assert cell.world.volumes.files == files


def test_the_whole_controller_is_backed_up_first_and_reset_rapid_says_what_it_takes(tmp_path: Path) -> None:
    with rws_cell_apart() as cell:
        cell.does(lambda: bare(cell))
        cell.world.memory.modules["T_ROB1"]["Welding"] = "ProgMod"
        done = run(cell, 2, "--yes", "--backup", tmp_path)
        assert done.status == 0, done.err
        assert "IT DELETES ALL PROGRAMS" in done.out
        assert "Nothing tells which modules have unsaved changes (positions modified): save first" in done.out
        assert "no configuration loads T_ROB1/Welding" in done.out
        assert "T_ROB1 holds Welding: a task has one main: --called, when that program is to stay" in done.out
        saved = [path for path in cell.world.volumes.files if path.startswith("BACKUP/")]
        assert saved
        assert saved[0].partition("/SYSPAR")[0] in done.out
        assert b"T_HANDEYED" not in b"".join(cell.world.volumes.files[path] for path in saved)
        assert b'cell_address :="127.0.0.1";' in cell.world.volumes.files["HOME/handeyed/CELL_shared.sys"]


def test_nothing_is_changed_when_the_backup_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drivers.robots.abb.rws.administration.BACKUP_LIMIT_S", 0)
    with rws_cell_apart() as cell:
        cell.does(lambda: bare(cell))
        ran = run(cell, 1, "--yes", "--backup", tmp_path)
        assert ran.status == 1
        assert "was not ready in 0 s" in ran.err
        assert not of_home(cell)


@pytest.mark.parametrize("code", ["-1073442814", "3221524482"])
def test_a_backup_that_ends_with_an_error_is_no_backup(
    code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is "ready" all the same: its code tells, with a sign or without."""
    failed = Item("progress", "1", {"state": "ready", "code": code})

    def with_a_full_disk(context: RequestContext) -> Reply:
        return Reply(items=[failed]) if "/progress/" in context.asked.path else answer_request(context)

    monkeypatch.setattr("mock_robot.rws.service.answer_request", with_a_full_disk)
    with rws_cell_apart() as cell:
        cell.does(lambda: bare(cell))
        ran = run(cell, 2, "--yes", "--backup", tmp_path)
        assert ran.status == 1
        assert f"failed ({code}): make one at the pendant" in ran.err
        assert not of_home(cell)


@pytest.mark.slow
@pytest.mark.parametrize("version", [1, 2])
def test_a_controller_with_more_signals_than_a_page_is_set_up(version: int, tmp_path: Path) -> None:
    with rws_cell_apart() as cell:
        cell.does(lambda: bare(cell))
        signals = {f"signal_{n}": CfgInstance("EIO_SIGNAL", {"Name": f"signal_{n}"}, n) for n in range(173)}
        cell.world.equipment.configuration = {"EIO": {"EIO_SIGNAL": dict(signals)}}
        done = run(cell, version, "--yes", "--backup", tmp_path)
        assert done.status == 0, done.out
        undone = handeyed("robot", "remove", cell.rws(version), "--backup", tmp_path, "--yes")
        assert undone.status == 0, undone.out
        assert cell.world.equipment.configuration["EIO"]["EIO_SIGNAL"] == signals


def deletes_nothing_by_id(context: RequestContext) -> Reply:
    asked = context.asked
    by_id = asked.method == "DELETE" and asked.path.rpartition("/")[2].isdecimal()
    return DONE if by_id else answer_request(context)


READINGS: dict[str, tuple[str, Callable[..., Any]]] = {
    "refused": ("mock_robot.rws.acting.instance_id", lambda title: "unknown"),
    "without effect": ("mock_robot.rws.service.answer_request", deletes_nothing_by_id),
}
"""What else than deleting a controller may do at DELETE of an entry's id, of which no answer is public."""


@pytest.mark.slow
@pytest.mark.parametrize("reading", READINGS)
def test_files_stay_while_the_configuration_names_them(
    reading: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else the controller's next start finds four entries that point to no file."""
    with rws_cell_apart() as cell:
        cell.does(lambda: bare(cell))
        assert run(cell, 2, "--yes", "--backup", tmp_path).status == 0
        files = dict(cell.world.volumes.files)
        with monkeypatch.context() as patch:
            patch.setattr(*READINGS[reading])
            undone = handeyed("robot", "remove", cell.rws(2), "--backup", tmp_path, "--yes")
        assert undone.status == 1
        by_hand = "delete it by hand (RobotStudio: Configuration, Controller), then run this again"
        assert f"FAIL  SYS CAB_TASK_MODULES CELL_comm: {by_hand}" in undone.out
        assert f"FAIL  SYS CAB_TASKS T_HANDEYED: {by_hand}" in undone.out
        assert "T_HANDEYED" in cell.world.equipment.configuration["SYS"]["CAB_TASKS"]  # its modules name it
        assert "kept, since the configuration still names them" in undone.out
        assert "Reset RAPID" not in undone.out
        assert cell.world.volumes.files == files
        del cell.world.equipment.configuration["SYS"]["CAB_TASK_MODULES"]  # by hand
        again = handeyed("robot", "remove", cell.rws(2), "--backup", tmp_path, "--yes")
        assert again.status == 0, again.out
        assert not of_home(cell)


@pytest.mark.slow
@pytest.mark.parametrize("version", [1, 2])
def test_a_bare_controller_is_set_up_read_back_and_undone(version: int, tmp_path: Path) -> None:
    with rws_cell_apart() as cell:
        cell.does(lambda: bare(cell))
        world, before = cell.world, {"HOME/handeyed/CELL_comm.mod": b"MODULE of_before\r\nENDMODULE\r\n"}
        world.volumes.files.update(before)
        done = run(cell, version, "--yes", "--backup", tmp_path, "--set", "cell_reach=555")
        assert done.status == 0, done.out + done.err
        assert "by hand  1. restart with Reset RAPID" in done.out
        assert b"PERS num cell_reach :=555;" in world.volumes.files["HOME/handeyed/CELL_shared.sys"]
        assert b'cell_address :="127.0.0.1";' in world.volumes.files["HOME/handeyed/CELL_shared.sys"]
        assert "T_HANDEYED" in world.equipment.configuration["SYS"]["CAB_TASKS"]
        assert "cell_do_motors" in world.equipment.configuration["EIO"]["EIO_SIGNAL"]
        cell.does(lambda: cell.controller.restart(cell.cell.clock()))
        cell.does(cell.cell.nudge)
        assert world.memory.tasks == {"T_ROB1": True, "T_HANDEYED": False}
        assert "write " not in run(cell, version, "--dry-run", "--set", "cell_reach=555").out
        undone = handeyed("robot", "remove", cell.rws(version), "--backup", tmp_path, "--yes")
        assert undone.status == 0, undone.out + undone.err
        assert of_home(cell) == before
        kinds = {kind for kinds in world.equipment.configuration.values() for kind, found in kinds.items() if found}
        assert kinds == {"FIREWALL_MANAGEMENT", "SYS_MISC"}


@pytest.mark.parametrize(
    ("options", "words", "absent"),
    [
        (("--called",), "write cell_motion; into your program", "CELL_main.mod"),
        (("--egm", "10.0.0.9"), "HOME:/handeyed/SIO_egm.cfg", "CELL_none"),
        (("--prefix", "left", "--port", "4243", "--link-task", "T_LINK"), "LEFT_shared.sys", "CELL_"),
        (("--to", "cal"), "HOME:/cal/CELL_main.mod", "HOME:/handeyed"),
    ],
)
def test_the_program_is_the_one_that_was_chosen(
    shared_cell: RwsCell, options: tuple[str, ...], words: str, absent: str
) -> None:
    ran = run(shared_cell, 1, "--dry-run", *options)
    assert ran.status == 0, ran.out + ran.err
    assert words in ran.out
    assert absent not in ran.out


def test_what_may_not_be_loaded_becomes_a_step_by_hand(tmp_path: Path) -> None:
    with rws_cell_apart() as cell:
        cell.does(lambda: (bare(cell), manual(cell), held(cell)))
        done = run(cell, 2, "--yes", "--backup", tmp_path, "--json")
        document = json.loads(done.out)
        assert done.status == 0, done.err
        assert document["plan"]["load"] == []
        assert [step for step in document["by_hand"] if "HOME:/handeyed/SYS.cfg" in step]
        assert of_home(cell).keys() == {f"HOME/handeyed/{name}" for name in document["plan"]["write"]}
        assert "CAB_TASKS" not in cell.world.equipment.configuration["SYS"]


def test_a_refusal_on_the_way_is_named_and_the_rest_goes_on(tmp_path: Path) -> None:
    with rws_cell_apart() as cell:
        cell.does(lambda: bare(cell))
        cell.world.equipment.load('EIO:CFG_1.0:6:0::\nSYSSIG_OUT:\n -Status "EmStop" -Signal "cell_do_estop"\n')
        done = run(cell, 1, "--yes", "--backup", tmp_path)
        assert done.status == 1
        assert "FAIL  load EIO.cfg" in done.out
        assert "Reset RAPID" not in done.out.partition("FAIL  load EIO.cfg")[2]
        assert "ok    load SYS.cfg" in done.out


@pytest.mark.slow
def test_settings_in_use_are_set_and_read_back(tmp_path: Path) -> None:
    with rws_cell_apart(program="rapid") as cell:
        done = run(
            cell, 1, "--yes", "--backup", tmp_path, "--set", "cell_reach=555", "--set", "cell_box_low=[-1, -2, 3]"
        )
        assert done.status == 0, done.out + done.err
        assert "ok    T_ROB1/CELL_shared/cell_reach := 555" in done.out
        symbol = cell.controller.symbol("t_rob1", "cell_shared", "cell_box_low")
        assert symbol is not None
        assert symbol.value == "[-1,-2,3]"
        assert handeyed("robot", "remove", cell.rws(1), "--backup", tmp_path, "--yes").status == 0
        assert symbol.value != "[-1,-2,3]"


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (("--set", "cell_reach"), 2, "write NAME=VALUE"),
        (("--set", "cell_of_none=1"), 1, "no such setting"),
        (("--set", "cell_reach=far"), 1, "this is no num"),
        (("--task", "T_ROB_L"), 1, "no motion task is named T_ROB_L: there are T_ROB1"),
    ],
)
def test_what_cannot_be_meant_is_refused(
    shared_cell: RwsCell, arguments: tuple[str, ...], status: int, words: str
) -> None:
    ran = run(shared_cell, 1, "--yes", *arguments)
    assert ran.status == status
    assert words in ran.out + ran.err
    assert not shared_cell.world.volumes.files


def test_nothing_is_done_without_consent(shared_cell: RwsCell) -> None:
    shared_cell.does(lambda: bare(shared_cell))
    refused = CliRunner().invoke(app, ["robot", "setup", shared_cell.rws(1)], input="n\n")
    assert refused.exit_code == 1
    assert "nothing was changed" in refused.stderr
    assert not shared_cell.world.volumes.files


def test_a_backup_that_is_none_is_refused(shared_cell: RwsCell, tmp_path: Path) -> None:
    ran = handeyed("robot", "remove", shared_cell.rws(1), "--backup", tmp_path, "--yes")
    assert ran.status == 2
    assert "no backup of a setup" in ran.err
