"""`handeyed robot acceptance` at the mock: the shipped program passes every row, and each fault fails its own."""

import asyncio
import json
import socket
from collections.abc import Callable, Iterator
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest

from calibration.transforms import Array, rotation_from_vector, transform
from daemon.cli.robot_acceptance import Operator
from daemon.tools.acceptance_report import RobotAcceptanceDocument, acceptance_document, acceptance_page
from drivers.registry import cb_transport
from drivers.robots.abb.acceptance.bench import AcceptanceLimits, Bench, RowSkipped
from drivers.robots.abb.acceptance.person import TO_MANUAL, Answer, Person, Step
from drivers.robots.abb.acceptance.program import ROWS, RowResult, head, run_rows
from drivers.robots.abb.acceptance.rows_motion import WRAP_MS, fastest_mm_s
from drivers.robots.abb.rws.address import RwsAddress
from mock_robot.faults.robot_faults import FAULTS
from mock_robot.links import cb_program, servers
from mock_robot.links.cb_program import Controller
from mock_robot.rws import equipment
from protocols.cb import messages as cb
from protocols.cb.codes import Command, Status
from protocols.cb.frames import Frame
from protocols.cb.layouts import pack
from protocols.cfg_file import CfgInstance
from tests.daemon.cli.running import handeyed
from tests.mock_robot.rws_cell import RwsCell, rws_cell_apart
from tests.support.waiting import LIMIT_S

QUICK = AcceptanceLimits(
    reads=40, samples=20, idle_s=0.5, stand_s=0.3, slow_mm_s=25.0, reply_s=0.35, stop_s=1.5, reconnect_s=20.0
)
PATIENT = replace(QUICK, repeats=10, reply_s=LIMIT_S, service_s=LIMIT_S, stop_s=LIMIT_S, margin_s=3.0)
"""For a cell without a fault on a busy machine."""
PATIENT_OPTIONS = [f"{name}={value}" for name, value in vars(PATIENT).items() if value is not None]


def ignore(text: str) -> None:
    """Take no note."""


class Willing:
    """Answers every step without doing anything."""

    def __init__(self, answer: Answer = Answer.DONE) -> None:
        self.answer, self.steps, self.note = answer, list[str](), ignore

    async def do(self, step: Step) -> Answer:
        self.steps.append(step.code)
        self.note(step.text)
        return self.answer


def try_row(
    cell: RwsCell, row: str, limits: AcceptanceLimits = QUICK, address: str = "", person: Person | None = None
) -> RowResult:
    """Run one row with a person at the mock's switches."""
    link = address or f"tcp://{cell.robot[0]}:{cell.robot[1]}"
    bench = Bench(cb_transport(link), RwsAddress.parse(cell.rws(1)), person or Operator(cell.control), limits)
    rows = [each for each in ROWS if each.code == row]
    return asyncio.run(run_rows(bench, rows, lambda result: None))[0]


@pytest.mark.slow
def test_the_shipped_program_passes_every_row(tmp_path: Path) -> None:
    with rws_cell_apart(program="rapid", time_scale=1.0) as cell:
        report = tmp_path / "report.html"
        limits = [part for each in PATIENT_OPTIONS for part in ("--limit", each)]
        ran = handeyed(
            "robot", "acceptance", f"tcp://{cell.robot[0]}:{cell.robot[1]}", "--services", cell.rws(1),
            "--operator", cell.control, "--report", report, *limits,
        )  # fmt: skip
    document = json.loads(report.with_suffix(".json").read_text())
    failing = [row for row in document["rows"] if row["verdict"] == "failed"]
    assert ran.status == 0, failing
    assert [row["code"] for row in document["rows"] if row["verdict"] == "skipped"] == ["egm"]
    assert document["event_log"]
    RobotAcceptanceDocument.model_validate(document)
    assert "camera-speed" in report.read_text()
    measured = {row["code"]: row["measured"] for row in document["rows"]}["camera-speed"]
    assert 0.3 * measured["asked mm/s"] < measured["fastest mm/s"] < 1.15 * measured["asked mm/s"]


@pytest.mark.slow
def test_a_program_that_does_not_know_how_far_the_camera_is_turns_too_fast() -> None:
    """Its cell_reach is a tenth of the camera's distance."""
    with rws_cell_apart(program="rapid", time_scale=1.0) as cell:
        ran = try_row(cell, "camera-speed", replace(QUICK, reach_mm=4000.0))
    assert (ran.verdict, "set cell_reach" in ran.what) == ("failed", True)


def a_turn(deg_s: float, first_ms: int = 0) -> list[tuple[int, Array]]:
    """Poses every 20 ms of a flange that turns for a second, by a clock that wraps."""
    return [
        ((first_ms + ms) % WRAP_MS, transform(rotation_from_vector([0, 0, np.radians(deg_s * ms / 1000)]), [9.0, 0, 0]))
        for ms in range(0, 1000, 20)
    ]


@pytest.mark.parametrize("first_ms", [0, WRAP_MS - 500])
def test_the_fastest_point_is_that_at_the_reach(first_ms: int) -> None:
    turn = a_turn(90.0, first_ms)
    assert fastest_mm_s(turn, 400.0) == pytest.approx(400.0 * np.pi / 2, rel=0.01)
    assert fastest_mm_s(turn[:8], 400.0) is None


LINK = {
    **dict.fromkeys(("link-delay", "link-stall"), "timings"),
    **dict.fromkeys((name for name in FAULTS if name.startswith("link-")), "clean-line"),
    "link-delay": "timings",
    "link-stall": "timings",
    "link-restart": "clock",
}
OTHERS = {
    "robot-emergency-stop": "ready",
    "robot-motors-off": "ready",
    "robot-manual-mode": "ready",
    "robot-program-stopped": "ready",
    "robot-not-settled": "round-trip",
    "robot-override-zero": "round-trip",
    "robot-nan-pose": "pose",
    "robot-quaternion-not-unit": "pose",
    "robot-metres": "frames",
    "robot-quaternion-xyzw": "frames",
    "robot-wrong-configuration": "posture",
    "robot-clock-jump": "clock",
    "rws-401": "services",
    "rws-406": "services",
    "rws-503": "services",
    "rws-slow": "services",
    "rws-garbage": "services",
    "rws-sessions-exhausted": "services",
    "rws-mastership-held": "mastership",
    "rws-subscription-gone": "events",
    "rws-other-tool": "selection",
}
LATE = {"link-restart", "robot-clock-jump"}
"""Faults that begin with the first move of their row."""
AT_2_0 = {"rws-410"}
ELSEWHERE = AT_2_0 | {name for name in FAULTS if name.startswith(("serial-", "egm-"))}


def ends_at_borders(controller: Controller, seq: int, request: cb.Move, now_s: float) -> cb.Reply:
    """A program that takes a goal in its own quarter turn only, and has no word for another one."""
    there = controller.arm.arm.configuration(controller.arm.joints_at(controller.robot_s(now_s)))
    same = abs(request.configuration[2] - there[2]) != 1
    return Controller._move_request(controller, seq, request, now_s) if same else cb.Refused(Status.BAD_FIELD)


def writes_each_time(controller: Controller, seq: int, request: cb.Ping, now_s: float) -> cb.Reply:
    controller.record(now_s, 80003, "a client is there")
    return cb.Pong()


def forgets_to_stop(controller: Controller, seq: int, request: cb.Stop, now_s: float) -> cb.Reply:
    return cb.Stopped()


async def greets(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Serve a second client, too."""
    seq = int.from_bytes((await reader.read(servers.CHUNK))[4:6], "little")
    welcome = pack(cb.Welcome(1, cb_program.CAPABILITIES, 1, 1, 1024, 6))
    writer.write(Frame(Command.HELLO | 0x80, seq, welcome).encode())
    await writer.drain()


FLAWS: dict[str, Callable[[pytest.MonkeyPatch], None]] = {
    "equipment": lambda patch: patch.setattr(equipment, "OPTIONS", {1: ("616-1 PC Interface",)}),
    "refusals": lambda patch: patch.setattr(cb_program, "MAX_SPEED_MM_S", 1e9),
    "stop": lambda patch: patch.setitem(cb_program._HANDLERS, cb.Stop, forgets_to_stop),
    "borders": lambda patch: patch.setitem(cb_program._HANDLERS, cb.Move, ends_at_borders),
    "silence": lambda patch: patch.setattr(cb_program, "HEARTBEAT_S", 1e9),
    "killed": lambda patch: patch.setattr(Controller, "disconnect", lambda controller, now_s: None),
    "second-client": lambda patch: patch.setattr(servers, "_turn_away", greets),
    "event-log": lambda patch: patch.setitem(cb_program._HANDLERS, cb.Ping, writes_each_time),
}
"""Flaws of a program, each of which one row is there to find."""
IDLE_PERSON = ("plug", "estop", "key", "enabling-device", "program-stop", "power-cut", "power-cut-main", "restart")
"""Rows that fail when nothing happens at the controller."""


@pytest.fixture(scope="module")
def cell() -> Iterator[RwsCell]:
    with rws_cell_apart(serial=True) as running:
        yield running


def test_every_fault_has_its_row() -> None:
    assert set(LINK) | set(OTHERS) | ELSEWHERE == set(FAULTS)


@pytest.mark.slow
@pytest.mark.parametrize(("fault", "row"), sorted({**LINK, **OTHERS}.items()))
def test_a_fault_fails_its_row(cell: RwsCell, fault: str, row: str) -> None:
    cell.does(lambda: cell.cell.inject_fault(fault, after_moves=int(fault in LATE)))
    try:
        result = try_row(cell, row)
    finally:
        cell.does(cell.cell.clear_faults)
        cell.does(lambda: cell.controller.recover(cell.cell.clock()))
    assert result.verdict == "failed", result
    assert result.what


def test_every_row_has_something_that_fails_it() -> None:
    elsewhere = {"egm", "camera-speed", "reads"}
    assert {*LINK.values(), *OTHERS.values(), *FLAWS, *IDLE_PERSON, *elsewhere} == {row.code for row in ROWS}


@pytest.mark.slow
@pytest.mark.parametrize("row", sorted(FLAWS))
def test_a_flaw_of_the_program_fails_its_row_alone(row: str, monkeypatch: pytest.MonkeyPatch) -> None:
    limits = replace(QUICK, idle_s=1.5, slow_mm_s=2.0 if row in ("silence", "killed") else QUICK.slow_mm_s)
    with rws_cell_apart() as cell:
        FLAWS[row](monkeypatch)
        others = [try_row(cell, other) for other in ("timings", "pose", "round-trip")]
        result = try_row(cell, row, limits)
    assert [other.verdict for other in others] == ["passed"] * 3, others
    assert result.verdict == "failed", result


@pytest.mark.slow
@pytest.mark.parametrize("row", IDLE_PERSON)
def test_a_switch_that_does_nothing_fails_its_row(row: str) -> None:
    with rws_cell_apart() as cell:
        result = try_row(cell, row, replace(QUICK, reconnect_s=1.0), person=Willing())
    assert result.verdict == "failed", result


@pytest.mark.slow
@pytest.mark.parametrize(("reads", "verdict"), [(1000, "passed"), (40, "failed")])
def test_few_repeats_among_many_reads_are_reported_and_accepted(reads: int, verdict: str) -> None:
    with rws_cell_apart() as cell:
        cell.does(lambda: cell.cell.inject_fault("link-reply-lost", strikes=2, only=Command.GET_POSE))
        result = try_row(cell, "reads", replace(QUICK, reads=reads, repeats_share=0.01))
    assert result.verdict == verdict, result
    assert verdict == "failed" or float(result.measured["repeats"]) >= 2.0


def test_the_mains_are_cut_last_and_by_consent(cell: RwsCell) -> None:
    assert [row.code for row in ROWS[-2:]] == ["power-cut", "power-cut-main"]
    before = cell.controller.session
    assert try_row(cell, "power-cut", person=Willing(Answer.NO)).verdict == "skipped"
    assert cell.controller.session == before


def test_a_cabinet_without_a_key_is_spoken_of_as_one(cell: RwsCell) -> None:
    options = ("616-1 PC Interface", "623-1 Multitasking", "3044-2 Keyless Mode Switch, 2 modes")
    for have, words in ((options[:2], "turn the key to manual"), (options, "choose manual")):
        person, shown = Willing(Answer.SKIP), list[str]()
        bench = Bench(cb_transport("tcp://127.0.0.1:1"), RwsAddress.parse(cell.rws(1)), person, QUICK)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(equipment, "OPTIONS", {1: have})
            asyncio.run(head(bench))
        person.note = shown.append
        with pytest.raises(RowSkipped):
            asyncio.run(bench.ask_person(TO_MANUAL))
        assert words in shown[0]


def test_the_head_names_controller_modules_and_how_to_see_the_background_task(cell: RwsCell) -> None:
    entry = {"File": "HOME:/handeyed/CELL_comm.mod", "ModName": "CELL_comm", "Task": "T_HANDEYED"}
    have = cell.world.equipment.configuration
    have["SYS"]["CAB_TASK_MODULES"] = {entry["File"]: CfgInstance("CAB_TASK_MODULES", entry, 1)}
    cell.world.volumes.files["HOME/handeyed/CELL_comm.mod"] = b"MODULE CELL_comm"
    try:
        bench = Bench(cb_transport("tcp://127.0.0.1:1"), RwsAddress.parse(cell.rws(2)), Willing(), QUICK)
        shown = asyncio.run(head(bench))
    finally:
        del have["SYS"]["CAB_TASK_MODULES"], cell.world.volumes.files["HOME/handeyed/CELL_comm.mod"]
    assert shown["rwversion"].startswith("7.")
    assert shown["CELL_comm"] == f"SHA-256 {sha256(b'MODULE CELL_comm').hexdigest()[:16]}"
    assert "Task: T_HANDEYED, Type NORMAL" in shown["background task"]


@pytest.mark.parametrize("fault", sorted(name for name in FAULTS if name.startswith("serial-")))
def test_a_fault_of_the_serial_line_fails_its_row(cell: RwsCell, fault: str) -> None:
    cell.does(lambda: cell.cell.inject_fault(fault))
    try:
        result = try_row(cell, "clean-line", address=f"serial://{cell.serial}")
    finally:
        cell.does(cell.cell.clear_faults)
    assert result.verdict == "failed", result


def test_a_quiet_cell_passes_the_rows_that_faults_fail(cell: RwsCell) -> None:
    for row in sorted({*LINK.values(), *OTHERS.values()}):
        result = try_row(cell, row, PATIENT)
        assert result.verdict == "passed", result
    assert try_row(cell, "clean-line", address=f"serial://{cell.serial}").verdict == "passed"


def test_mastership_that_robotware_8_does_not_have_fails_its_row(cell: RwsCell) -> None:
    cell.does(lambda: cell.cell.inject_fault("rws-410"))
    bench = Bench(cb_transport("tcp://127.0.0.1:1"), RwsAddress.parse(cell.rws(2)), Willing(), QUICK)
    rows = [each for each in ROWS if each.code == "mastership"]
    try:
        assert asyncio.run(run_rows(bench, rows, lambda result: None))[0].verdict == "failed"
    finally:
        cell.does(cell.cell.clear_faults)


@pytest.mark.slow
def test_egm_that_is_not_as_it_should_be_fails_its_row() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    limits = AcceptanceLimits(egm_port=port)
    with rws_cell_apart(egm=("127.0.0.1", port)) as cell:
        for fault in sorted(name for name in FAULTS if name.startswith("egm-")):
            cell.does(lambda fault=fault: cell.cell.inject_fault(fault))
            assert try_row(cell, "egm", limits).verdict == "failed", fault
            cell.does(cell.cell.clear_faults)
        assert try_row(cell, "egm", limits).verdict == "passed"


@pytest.mark.parametrize(("answer", "verdict"), [(Answer.SKIP, "skipped"), (Answer.NO, "failed")])
def test_what_the_person_answers_decides(answer: Answer, verdict: str) -> None:
    person = Willing(answer)
    with rws_cell_apart() as cell:
        assert try_row(cell, "frames", person=person).verdict == verdict
    assert person.steps == ["pendant"]


def test_without_services_rows_are_skipped_and_nothing_is_accepted(tmp_path: Path) -> None:
    ran = handeyed("robot", "acceptance", "tcp://127.0.0.1:1", "--only", "services", "--report", tmp_path / "r.html")
    assert ran.status == 1
    assert "skipped services" in ran.out
    assert json.loads((tmp_path / "r.json").read_text())["counts"] == {"passed": 0, "failed": 0, "skipped": 1}


@pytest.mark.parametrize(
    ("options", "words"),
    [(("--only", "none"), "there is no such row"), (("--limit", "reads=many"), "this is no limit")],
)
def test_what_cannot_be_meant_is_refused(options: tuple[str, str], words: str) -> None:
    ran = handeyed("robot", "acceptance", "tcp://127.0.0.1:1", *options)
    assert (ran.status, words in ran.err) == (2, True)


def test_the_page_escapes_what_the_controller_says() -> None:
    row = {"code": "x", "assumption": "a", "verdict": "failed", "what": "<b>", "measured": {}, "seconds": 1.0}
    entry = {"at": "now", "code": 10, "title": "<script>"}
    page = acceptance_page(
        acceptance_document([row], address="tcp://a", handeyed="1", began_at="now", controller={}, event_log=[entry])
    )
    assert "<script>" not in page
    assert "&lt;b&gt;" in page
