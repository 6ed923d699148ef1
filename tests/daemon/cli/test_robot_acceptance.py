"""`handeyed robot acceptance` at the mock: the shipped program passes every row, and each fault fails its own."""

import asyncio
import json
import socket
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from calibration.transforms import Array, rotation_from_vector, transform
from daemon.cli.robot_acceptance import Operator, accept
from daemon.tools.acceptance_report import RobotAcceptanceDocument, acceptance_document, acceptance_page
from drivers.registry import cb_transport
from drivers.robots.abb.acceptance import bench as bench_module
from drivers.robots.abb.acceptance import rows_link
from drivers.robots.abb.acceptance.bench import AcceptanceLimits, Bench, RowSkipped
from drivers.robots.abb.acceptance.person import TO_MANUAL, Answer, Person, Step
from drivers.robots.abb.acceptance.program import ROWS, RowResult, head, run_rows
from drivers.robots.abb.acceptance.rows_motion import fastest_mm_s
from drivers.robots.abb.egm_vibration import EgmMonitor
from drivers.robots.abb.rws.address import RwsAddress
from drivers.robots.abb.rws.administration import RwsAdministration
from drivers.timing import Timing
from drivers.transports.tcp import TcpConnection
from mock_robot.cell import MockCell, Ports
from mock_robot.faults.tables import FAULTS
from mock_robot.links import cb_program, servers
from mock_robot.links.cb_program import Controller
from mock_robot.rapid.controller import DEPLOYED
from mock_robot.rws import equipment, reading
from mock_robot.rws.exchange import Item
from mock_robot.rws.world import World
from mock_robot.truth.truth import CellTruth
from protocols.cb import messages as cb
from protocols.cb.codes import Command, Flag, Status
from protocols.cb.frames import Frame
from protocols.cb.layouts import pack
from protocols.cb.messages import T_MS_WRAP
from protocols.cfg_file import CfgInstance
from tests.daemon.cli.running import handeyed
from tests.mock_robot.rws_cell import RwsCell, rws_cell_apart
from tests.support.cases import seeds
from tests.support.skipping_loop import SkippingLoop, run_skipping
from tests.support.waiting import LIMIT_S

SHORT = AcceptanceLimits(reads=200, samples=40, idle_s=5.0, egm_port=0)
"""Sizes and speeds of the moves are those of an hour; what is only repeated or waited for is less."""
QUICK = AcceptanceLimits(
    reads=40, samples=20, idle_s=0.5, stand_s=0.3, slow_mm_s=25.0, reply_s=0.35, stop_s=1.5, reconnect_s=20.0
)
PATIENT = replace(QUICK, repeats=10, reply_s=LIMIT_S, service_s=LIMIT_S, stop_s=LIMIT_S, margin_s=3.0, slow_mm_s=15.0)
"""For a cell without a fault on a busy machine."""
PATIENT_OPTIONS = [f"{name}={value}" for name, value in vars(PATIENT).items() if value is not None]


def ignore(text: str) -> None:
    """Take no note."""


class Willing:
    """Answers every step without doing anything."""

    def __init__(self, answer: Answer = Answer.DONE) -> None:
        self.answer, self.steps, self.note = answer, list[str](), cast("Callable[[str], None]", ignore)

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
    return asyncio.run(run_rows(bench, [each for each in ROWS if each.code == row], lambda result: None))[0]


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
    turns = {ms: rotation_from_vector([0, 0, np.radians(deg_s * ms / 1000)]) for ms in range(0, 1000, 20)}
    return [((first_ms + ms) % T_MS_WRAP, transform(turn, [9.0, 0, 0])) for ms, turn in turns.items()]


@pytest.mark.parametrize("first_ms", [0, T_MS_WRAP - 500])
def test_the_fastest_point_is_that_at_the_reach(first_ms: int) -> None:
    turn = a_turn(90.0, first_ms)
    assert fastest_mm_s(turn, 400.0) == pytest.approx(400.0 * np.pi / 2, rel=0.01)
    assert fastest_mm_s(turn[:8], 400.0) is None


@dataclass
class ALine:
    """A line in memory to the Python program of a cell; each piece of an answer takes `answer_s`."""

    cell: MockCell
    answer_s: float = 0.0
    address: str = "memory"
    resynchronise: bool = False
    half_frame_limit_s: float = 2.0

    async def connect(self) -> TcpConnection:
        ours, theirs = socket.socketpair()
        server = self.cell._wires._tcp  # type: ignore[attr-defined]
        self._serving = asyncio.create_task(server._accept(*await asyncio.open_connection(sock=theirs)))
        connection = TcpConnection(self.address, *await asyncio.open_connection(sock=ours))
        at_once = connection.receive

        async def receive() -> bytes:
            data = await at_once()
            await asyncio.sleep(self.answer_s)
            return data

        connection.receive = receive  # type: ignore[method-assign]
        return connection


Fault = Callable[[pytest.MonkeyPatch, MockCell], None]


def no_fault(patch: pytest.MonkeyPatch, cell: MockCell) -> None:
    """The cell is as it should be."""


async def _accept(fault: Fault, rows: Collection[str], limits: AcceptanceLimits, who: Any, answer_s: float) -> Any:
    loop = cast("SkippingLoop", asyncio.get_running_loop())
    cell = MockCell(CellTruth.from_seed(7), clock=loop.time, session=3)
    ports = await cell.start(Ports(devices=None, rws=(0, 0)))
    assert ports.rws is not None
    where = RwsAddress.parse("rws://" + ports.rws.first.partition("//")[2])
    bench = Bench(ALine(cell, answer_s), where, who(ports.control_url), limits, Timing(loop.time))

    class Streamed(EgmMonitor):
        """While it listens, the cell streams to it, and time does not pass it by."""

        def start(self) -> None:
            super().start()
            loop.selector.unread = self._socket
            self.streaming = loop.create_task(cell.egm.start("127.0.0.1", self.port))

        def close(self) -> None:
            loop.selector.unread = None
            self.closing = loop.create_task(cell.egm.close())
            super().close()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rows_link, "EgmMonitor", Streamed)
        patch.setattr(bench_module, "POLL_S", 0.1)  # an hour has few turns of the loop then
        fault(patch, cell)
        try:
            return await accept(bench, [row for row in ROWS if row.code in rows], lambda result: None), loop.time()
        finally:
            await cell.close()


EVERY = tuple(row.code for row in ROWS)


def acceptance(
    fault: Fault = no_fault,
    rows: Collection[str] = EVERY,
    limits: AcceptanceLimits = SHORT,
    who: Any = Operator,
    answer_s: float = 0.0,
) -> tuple[dict[str, Any], float]:
    """The report, and how many seconds it took, of a cell in a time that waits for nothing."""
    document, seconds = run_skipping(_accept(fault, rows, limits, who, answer_s))
    return document, seconds


def verdicts(document: dict[str, Any]) -> dict[str, str]:
    return {row["code"]: row["verdict"] for row in document["rows"]}


def mock_fault(name: str, only: Command | None = None, after_moves: int = 0) -> Fault:
    """One that the mock has by name."""
    return lambda patch, cell: cell.inject_fault(name, only=only, after_moves=after_moves)


def answers(kind: type[Any], change: Callable[[Any], Any]) -> Fault:
    """The program answers a kind of request wrongly."""
    rightly = cb_program._HANDLERS[kind]
    return lambda patch, cell: patch.setitem(
        cb_program._HANDLERS, kind, lambda c, seq, request, now_s: change(rightly(c, seq, request, now_s))
    )


def does(kind: type[Any], act: Callable[[Controller, int, Any, float], cb.Reply]) -> Fault:
    """The program does something else when it is asked for this."""
    return lambda patch, cell: patch.setitem(cb_program._HANDLERS, kind, act)


def has(owner: Any, name: str, value: Any) -> Fault:
    """Something of the mock is another."""
    return lambda patch, cell: patch.setattr(owner, name, value)


def without(option: str) -> Fault:
    return lambda patch, cell: setattr(cell.rws.world.equipment, "without", frozenset({option}))


def unmoved(step: str) -> Fault:
    """Whoever is asked for this does nothing."""
    return lambda patch, cell: patch.setitem(Operator.ACTS, step, ())


def goes_on(step: str) -> Fault:
    """When this has been done, the arm moves by itself, as by an old move."""

    def fault(patch: pytest.MonkeyPatch, cell: MockCell) -> None:
        joints_deg = np.degrees(cell.controller.arm.joints_at(0.0) - 0.1)
        jog = ("POST", "/jog", {"joints_deg": joints_deg.tolist(), "in_s": 4.0})
        patch.setitem(Operator.ACTS, step, (*Operator.ACTS[step], jog))

    return fault


def ends_at_borders(controller: Controller, seq: int, request: cb.Move, now_s: float) -> cb.Reply:
    """A program that takes a goal in its own quarter turn only, and has no word for another one."""
    there = controller.arm.arm.configuration(controller.arm.joints_at(controller.robot_s(now_s)))
    same = abs(request.configuration[2] - there[2]) != 1
    return Controller._move_request(controller, seq, request, now_s) if same else cb.Refused(Status.BAD_FIELD)


def misses(controller: Controller, seq: int, request: cb.Move, now_s: float) -> cb.Reply:
    """A program whose arm stops a third of a millimetre above its goal."""
    x, y, z = request.position_mm
    return Controller._move_request(controller, seq, replace(request, position_mm=(x, y, z + 0.3)), now_s)


def writes_each_time(controller: Controller, seq: int, request: cb.Ping, now_s: float) -> cb.Reply:
    controller.record(now_s, 80003, "a client is there")
    return cb.Pong()


def forgets_to_stop(controller: Controller, seq: int, request: cb.Stop, now_s: float) -> cb.Reply:
    return cb.Stopped()


def forgets_its_client(controller: Controller, now_s: float) -> None:
    """When the connection has ended, it neither stops nor counts the silence."""
    controller._heard_at_s = None


def goes_on_without_a_plug(patch: pytest.MonkeyPatch, cell: MockCell) -> None:
    halts = Controller.halt
    patch.setattr(
        Controller, "halt", lambda c, *how: None if "link-half-open" in cell.faults.active else halts(c, *how)
    )


def tires(patch: pytest.MonkeyPatch, cell: MockCell) -> None:
    """After 150 poses in one connection the program gives none any more."""
    asked = 0

    def greet(controller: Controller, seq: int, request: cb.Hello, now_s: float) -> cb.Reply:
        nonlocal asked
        asked = 0
        return Controller._hello(controller, seq, request, now_s)

    def pose(controller: Controller, seq: int, request: cb.GetPose, now_s: float) -> cb.Reply:
        nonlocal asked
        asked += 1
        rightly = Controller._pose(controller, seq, request, now_s)
        return rightly if asked <= 150 else replace(rightly, position_mm=(np.nan,) * 3)  # type: ignore[arg-type]

    patch.setitem(cb_program._HANDLERS, cb.Hello, greet)
    patch.setitem(cb_program._HANDLERS, cb.GetPose, pose)


async def greets(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Serve a second client, too."""
    seq = int.from_bytes((await reader.read(servers.CHUNK))[4:6], "little")
    welcome = pack(cb.Welcome(1, cb_program.CAPABILITIES, 1, 1, 1024, 6))
    writer.write(Frame(Command.HELLO | 0x80, seq, welcome).encode())
    await writer.drain()


def shows_another_place(world: World, *names: str) -> tuple[Array, Array]:
    position, quaternion = HERE(world, *names)
    return position + 1.0, quaternion


def shows_another_posture(world: World) -> tuple[int, int, int, int]:
    cf1, cf4, cf6, cfx = POSTURE(world)
    return cf1, cf4, cf6, cfx ^ 2


HERE, POSTURE = World.pose, World.configuration.fget  # type: ignore[attr-defined]
LATE_CLOCK = lambda c, now_s: int((now_s - c._greeted_at_s) * 1200) % cb.T_MS_WRAP  # noqa: E731
FAULT_OF_ROW: dict[str, Fault] = {
    "ready": answers(cb.GetStatus, lambda report: replace(report, flags=report.flags & ~Flag.TASK_RUNNING)),
    "equipment": without("623-1"),
    "services": mock_fault("rws-slow"),
    "mastership": mock_fault("rws-mastership-held"),
    "selection": mock_fault("rws-other-tool"),
    "clean-line": mock_fault("link-split"),
    "timings": mock_fault("link-delay", only=Command.MOVE),
    "pose": answers(
        cb.GetPose, lambda pose: replace(pose, quaternion_wxyz=tuple(1.001 * q for q in pose.quaternion_wxyz))
    ),
    "posture": has(World, "configuration", property(shows_another_posture)),
    "frames": has(World, "pose", shows_another_place),
    "second-client": has(servers, "_turn_away", greets),
    "egm": mock_fault("egm-loss"),
    "refusals": has(cb_program, "MAX_SPEED_MM_S", 1e9),
    "round-trip": does(cb.Move, misses),
    "clock": has(Controller, "_t_ms", LATE_CLOCK),
    "stop": does(cb.Stop, forgets_to_stop),
    "camera-speed": has(cb_program, "REACH_MM", 40.0),
    "borders": does(cb.Move, ends_at_borders),
    "silence": has(cb_program, "HEARTBEAT_S", 1e9),
    "killed": has(Controller, "disconnect", forgets_its_client),
    "plug": goes_on_without_a_plug,
    "estop": goes_on("estop-release"),
    "key": unmoved("to-manual"),
    "enabling-device": unmoved("disable"),
    "program-stop": goes_on("program-start"),
    "restart": unmoved("restart"),
    "events": mock_fault("rws-subscription-gone"),
    "event-log": does(cb.Ping, writes_each_time),
    "reads": tires,
    "power-cut": goes_on("power-on"),
    "power-cut-main": goes_on("power-on-main"),
}
"""For each row what is wrong with a controller that fails this row and no other."""
ROWS_OF_FAULTS = {
    **dict.fromkeys((name for name in FAULTS if name.startswith("link-")), "clean-line"),
    **dict.fromkeys((name for name in FAULTS if name.startswith("egm-")), "egm"),
    "link-delay": "timings",
    "link-stall": "timings",
    "link-restart": "clock",
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
"""A row that each fault of the mock fails."""
LATE = {"link-restart", "robot-clock-jump"}
"""Faults that begin with the first move of their row."""
ELSEWHERE = {"rws-410"} | {name for name in FAULTS if name.startswith("serial-")}
IDLE_PERSON = ("plug", "estop", "key", "enabling-device", "program-stop", "power-cut", "power-cut-main", "restart")
"""Rows that fail when nothing happens at the controller."""


@pytest.fixture(scope="module")
def cell() -> Iterator[RwsCell]:
    with rws_cell_apart(serial=True) as running:
        yield running


def test_every_row_has_its_fault_and_every_fault_its_row() -> None:
    assert list(FAULT_OF_ROW) == list(EVERY)
    assert set(ROWS_OF_FAULTS) | ELSEWHERE == set(FAULTS)


def test_a_cell_without_a_fault_passes_every_row() -> None:
    assert verdicts(acceptance()[0]) == dict.fromkeys(EVERY, "passed")


@pytest.mark.slow
@pytest.mark.parametrize("row", EVERY)
def test_the_fault_of_a_row_fails_that_row_and_no_other(row: str) -> None:
    tried = EVERY if EVERY.index(row) in seeds(len(EVERY), every=6) else (row,)  # all rows take 3 s
    document, _ = acceptance(FAULT_OF_ROW[row], tried)
    assert verdicts(document) == {**dict.fromkeys(tried, "passed"), row: "failed"}, document["rows"]


@pytest.mark.parametrize(("fault", "row"), sorted(ROWS_OF_FAULTS.items()))
def test_a_fault_of_the_mock_fails_its_row(fault: str, row: str) -> None:
    document, _ = acceptance(mock_fault(fault, after_moves=int(fault in LATE)), [row])
    assert verdicts(document) == {row: "failed"}
    assert document["rows"][0]["what"]


@pytest.mark.parametrize("row", IDLE_PERSON)
def test_a_switch_that_does_nothing_fails_its_row(row: str) -> None:
    document, _ = acceptance(rows=[row], limits=replace(SHORT, reconnect_s=1.0), who=lambda url: Willing())
    assert verdicts(document) == {row: "failed"}


async def unlisted(controller: RwsAdministration) -> None:
    """A controller that does not say what it has."""


NOTHING_TO_MEASURE: dict[str, tuple[Fault, AcceptanceLimits, str]] = {
    "silence": (no_fault, replace(SHORT, travel_mm=30.0), "nothing measured"),
    "camera-speed": (no_fault, replace(SHORT, turn_deg=170.0), "jog the arm elsewhere"),
    "borders": (does(cb.Move, lambda *of: cb.Refused(Status.UNREACHABLE)), SHORT, "jog the arm elsewhere"),
    "selection": (has(reading, "Item", lambda kind, title, values: Item(kind, title, {})), SHORT, "is selected"),
    "equipment": (has(RwsAdministration, "read_options", unlisted), SHORT, "does not list its options"),
    "event-log": (mock_fault("rws-garbage"), SHORT, "no answer of RWS 1.0"),
}


@pytest.mark.parametrize("row", NOTHING_TO_MEASURE)
def test_a_row_that_measured_nothing_fails(row: str) -> None:
    fault, limits, words = NOTHING_TO_MEASURE[row]
    document, _ = acceptance(fault, [row], limits)
    assert verdicts(document) == {row: "failed"}
    assert words in document["rows"][0]["what"]


def test_entries_are_counted_beyond_the_50_that_the_log_shows() -> None:
    writes_much = does(cb.Ping, lambda *of: [writes_each_time(*of) for _ in range(20)].pop())
    document, _ = acceptance(writes_much, ["event-log"])
    assert int(document["rows"][0]["what"].partition(" ")[0]) > 100


@pytest.mark.parametrize(("reads", "verdict"), [(1000, "passed"), (40, "failed")])
def test_few_repeats_among_many_reads_are_reported_and_accepted(reads: int, verdict: str) -> None:
    def loses_two(patch: pytest.MonkeyPatch, cell: MockCell) -> None:
        cell.inject_fault("link-reply-lost", strikes=2, only=Command.GET_POSE)

    document, _ = acceptance(loses_two, ["reads"], replace(SHORT, reads=reads, repeats_share=0.01))
    assert verdicts(document) == {"reads": verdict}
    assert verdict == "failed" or document["rows"][0]["measured"]["repeats"] == 2.0


ANSWER_S, AT_HAND_S, UP_AGAIN_S = 0.05, 20.0, 180.0
"""What an answer, a person at the cabinet, and a start of the controller may take."""


class Unhurried(Operator):
    """A person who takes time."""

    async def do(self, step: Step) -> Answer:
        if not step.now:
            await asyncio.sleep(UP_AGAIN_S if step.code in ("power-on", "power-on-main", "restart") else AT_HAND_S)
        return await super().do(step)


def is_set_up(patch: pytest.MonkeyPatch, cell: MockCell) -> None:
    """The modules and their configuration are on the controller."""
    cell.rws.world.equipment.load((DEPLOYED / "rw6" / "SYS.cfg").read_text("ascii"))
    for file in DEPLOYED.glob("CELL_*"):
        cell.rws.world.volumes.files[f"HOME/handeyed/{file.name}"] = file.read_bytes()


@pytest.mark.slow
def test_an_hour_is_enough_and_the_report_says_what_was_tried_on_what() -> None:
    """By the waits and motions of the rows at real time, with default limits; nothing of it is waited for."""
    document, seconds = acceptance(is_set_up, limits=AcceptanceLimits(egm_port=0), who=Unhurried, answer_s=ANSWER_S)
    assert verdicts(document) == dict.fromkeys(EVERY, "passed")
    assert 1200.0 < seconds < 3600.0
    RobotAcceptanceDocument.model_validate(document)
    page = acceptance_page(document)
    files = [file for file in DEPLOYED.glob("CELL_*") if file.stem != "CELL_egm"]
    hashes = [sha256(file.read_bytes()).hexdigest()[:16] for file in files]
    told = ("handeyed mock", "6.16.1021", *hashes, "Task: T_HANDEYED, Type NORMAL", *EVERY, f"{seconds / 60:.0f} min")
    assert [words for words in told if words not in page] == []
    assert len(hashes) == 4
    assert document["event_log"]


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


def test_a_quiet_serial_line_passes(cell: RwsCell) -> None:
    assert try_row(cell, "clean-line", PATIENT, address=f"serial://{cell.serial}").verdict == "passed"


def test_mastership_that_robotware_8_does_not_have_fails_its_row(cell: RwsCell) -> None:
    cell.does(lambda: cell.cell.inject_fault("rws-410"))
    bench = Bench(cb_transport("tcp://127.0.0.1:1"), RwsAddress.parse(cell.rws(2)), Willing(), QUICK)
    rows = [each for each in ROWS if each.code == "mastership"]
    try:
        assert asyncio.run(run_rows(bench, rows, lambda result: None))[0].verdict == "failed"
    finally:
        cell.does(cell.cell.clear_faults)


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
