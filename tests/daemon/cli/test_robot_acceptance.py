"""`handeyed robot acceptance` at the mock: the shipped program passes every row, and each fault fails its own."""

import asyncio
import json
import socket
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calibration.transforms import Array, rotation_from_vector, transform
from daemon.cli.robot_acceptance import Operator
from daemon.tools.acceptance_report import RobotAcceptanceDocument, acceptance_document, acceptance_page
from drivers.registry import cb_transport
from drivers.robots.abb.acceptance.bench import AcceptanceLimits, Bench
from drivers.robots.abb.acceptance.person import Answer, Step
from drivers.robots.abb.acceptance.program import ROWS, RowResult, run_rows
from drivers.robots.abb.acceptance.rows_motion import WRAP_MS, fastest_mm_s
from drivers.robots.abb.rws.address import RwsAddress
from mock_robot.faults.robot_faults import FAULTS
from tests.daemon.cli.running import handeyed
from tests.mock_robot.rws_cell import RwsCell, rws_cell_apart
from tests.support.waiting import LIMIT_S

QUICK = AcceptanceLimits(
    reads=40, samples=20, idle_s=0.5, stand_s=0.3, slow_mm_s=25.0, reply_s=0.35, stop_s=1.5, reconnect_s=20.0
)
PATIENT = replace(QUICK, repeats=10, reply_s=LIMIT_S, service_s=LIMIT_S, stop_s=LIMIT_S, margin_s=3.0)
"""For a cell without a fault on a busy machine."""
PATIENT_OPTIONS = [f"{name}={value}" for name, value in vars(PATIENT).items() if value is not None]


class Willing:
    """Answers every step without doing anything."""

    def __init__(self, answer: Answer = Answer.DONE) -> None:
        self.answer, self.steps = answer, list[str]()

    async def do(self, step: Step) -> Answer:
        self.steps.append(step.code)
        return self.answer


def try_row(cell: RwsCell, row: str, limits: AcceptanceLimits = QUICK, address: str = "") -> RowResult:
    """Run one row with a person at the mock's switches."""
    link = address or f"tcp://{cell.robot[0]}:{cell.robot[1]}"
    bench = Bench(cb_transport(link), RwsAddress.parse(cell.rws(1)), Operator(cell.control), limits)
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
    "robot-wrong-configuration": "frames",
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
def test_what_the_person_answers_decides(cell: RwsCell, answer: Answer, verdict: str) -> None:
    person = Willing(answer)
    bench = Bench(cb_transport(f"tcp://{cell.robot[0]}:{cell.robot[1]}"), RwsAddress.parse(cell.rws(1)), person, QUICK)
    rows = [each for each in ROWS if each.code == "frames"]
    assert asyncio.run(run_rows(bench, rows, lambda result: None))[0].verdict == verdict
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
        acceptance_document(address="tcp://a", services=None, version="1", began_at="now", controller={},
                            results=[row], log=[entry])
    )  # fmt: skip
    assert "<script>" not in page
    assert "&lt;b&gt;" in page
