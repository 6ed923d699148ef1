"""GET, PUT /setup and POST /setup/try with stand-ins for controller and camera: what is checked and written."""

import asyncio
import math
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import pytest_asyncio

from calibration.targets import Chessboard
from daemon.config.settings import load_settings
from daemon.tools.first_setup import interview
from daemon.tools.first_setup.devices import SeenCamera, SeenController
from drivers.errors import DeviceUnreachable
from tests.calibration.detection.sights import pictures
from tests.daemon.access_keys import bearer, with_keys
from tests.daemon.cell_under_test import Bench
from tests.daemon.cli.running import handeyed

BOX = ((-500.0, -500.0, 0.0), (1500.0, 500.0, 1500.0))
CONTROLLER = SeenController(
    "tcp://10.0.0.2:4242", ("RobotWare 7.14",), "IRB 1600-6/1.45", None, BOX, (900.0, 0.0, 900.0), (0.0,) * 6
)
ANSWERS = {
    "controller": "10.0.0.2",
    "camera": "http://10.0.0.3/frame.png",
    "target": "chessboard:9x6:1",
    "size": "200/10 calliper",
    "box": "program",
}

Cell = tuple[Bench, dict[str, dict[str, str]], Path]


@pytest_asyncio.fixture
async def cell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Cell]:
    """A daemon that sets up a cell, the headers of each role, and the file that it writes."""
    board = pictures(Chessboard(9, 6, 20.0), 1)[0].image

    async def look_at_controller(answer: str, *frame: Any) -> SeenController:
        if answer != "10.0.0.2":
            raise DeviceUnreachable("robot", "nobody answers there", "correct the address")
        return CONTROLLER

    async def take_picture(address: str) -> SeenCamera:
        return SeenCamera(address, "a camera", board)

    async def read_robot(seen: SeenController) -> SeenController:
        return replace(seen, joints_rad=(0.0, 0.0, 0.0, 0.0, math.pi / 2, 0.0))

    async def find_controllers(*hosts: Any) -> list[str]:
        return ["10.0.0.2"]

    for stand_in in (look_at_controller, take_picture, read_robot):
        monkeypatch.setattr(interview, stand_in.__name__, stand_in)
    monkeypatch.setattr("daemon.api.routes.setup.find_controllers", find_controllers)
    monkeypatch.setattr("daemon.api.routes.setup.discover", list)
    file = tmp_path / "handeyed.toml"
    async with with_keys(tmp_path / "store") as (bench, keys):
        bench.application.setup_file = file
        yield bench, {role: bearer(keys[role]) for role in ("viewer", "operator", "admin")}, file


async def test_what_is_found_is_shown(cell: Cell) -> None:
    bench, headers, file = cell
    answer = await bench.client.get("/setup", headers=headers["admin"])
    assert answer.json() == {
        "set_up": False, "file": str(file), "sha256": None, "controllers": ["10.0.0.2"], "cameras": [],
        "before": {"answers": {}, "found": []},
    }  # fmt: skip


async def test_each_answer_is_checked_when_it_is_given(cell: Cell) -> None:
    bench, headers, file = cell

    async def attempt(question: str, **answers: str) -> Any:
        body = {"question": question, "answers": {**ANSWERS, **answers}}
        return await bench.client.post("/setup/try", json=body, headers=headers["admin"])

    controller = (await attempt("controller")).json()
    assert (controller["model"], controller["program_box_mm"]) == ("IRB 1600-6/1.45", [list(corner) for corner in BOX])
    assert controller["arm"]["skeleton_mm"][0] == [0, 0, 0]
    assert len(controller["arm"]["skeleton_mm"]) == 5
    assert (await attempt("controller", controller="10.0.0.9")).status_code == 503
    shorter = (await attempt("model", model="IRB 1600-6/1.2")).json()
    assert shorter["arm"]["lengths_mm"] != controller["arm"]["lengths_mm"]
    camera = (await attempt("camera")).json()
    assert camera["target"].startswith("chessboard:9x6:")
    assert (len(camera["corners"]), camera["of"]) == (54, 54)
    assert camera["picture"]
    assert (await attempt("target", target="chessboard:7x5:1")).json()["doubts"]
    assert (await attempt("size", size="wide")).json()["code"] == "answer-refused"
    assert 0.3 < (await attempt("size")).json()["expected_mm"] < 2.0
    assert (await attempt("box", box="here")).json()["answer"] == "900 0 900"
    corner = (await attempt("box", box="here")).json()
    assert (corner["complete"], corner["arm"]["joints_deg"]) == (False, [0, 0, 0, 0, 90, 0])
    assert (await attempt("tolerance", tolerance="-1")).status_code == 422
    assert not file.exists()
    assert not bench.robot.goals


async def test_the_file_is_written_once_for_the_state_that_was_read(cell: Cell) -> None:
    bench, headers, file = cell
    tag = (await bench.client.get("/setup", headers=headers["admin"])).headers["etag"]
    file.write_text("# somebody else's\n")

    async def write(tag: str, **answers: str) -> Any:
        body = {"answers": {**ANSWERS, **answers}}
        return await bench.client.put("/setup", json=body, headers={**headers["admin"], "If-Match": tag})

    assert (await write(tag)).json()["code"] == "setup-conflict"
    assert file.read_text() == "# somebody else's\n"
    tag = (await bench.client.get("/setup", headers=headers["admin"])).headers["etag"]
    assert (await write(tag, box="here")).json()["code"] == "answer-refused"

    written = (await write(tag)).json()

    assert written == {"file": str(file), "kept": f"{file}.1"}
    settings = load_settings(file)
    assert (settings.robot.address, settings.robot.box_mm) == (CONTROLLER.address, BOX)
    assert settings.target == Chessboard(9, 6, 20.0)
    assert file.with_name("handeyed.toml.1").read_text() == "# somebody else's\n"
    assert bench.application.begins_anew
    rows = await bench.application.store.audit.rows(5, None)
    assert next(row.action for row in rows) == "write settings"


async def test_a_target_is_printed_as_by_the_command(cell: Cell, tmp_path: Path) -> None:
    bench, headers, _ = cell

    async def printed(target: str, **page: str) -> Any:
        answer = bench.client.get("/setup/target.pdf", params={"target": target, **page}, headers=headers["admin"])
        return await answer

    board = "charuco:12x9:20:15:DICT_5X5_100"
    sheet = await printed(board, page="A3")
    assert sheet.headers["content-type"] == "application/pdf"
    counts = [
        "--columns",
        "12",
        "--rows",
        "9",
        "--square-mm",
        "20",
        "--marker-mm",
        "15",
        "--dictionary",
        "DICT_5X5_100",
    ]
    ran = await asyncio.to_thread(handeyed, "target", "charuco", *counts, "--page", "A3", "-o", tmp_path / "a.pdf")
    assert ran.status == 0, ran.err
    assert sheet.content == (tmp_path / "a.pdf").read_bytes()
    assert (await printed(board)).content == sheet.content, "A3 is the smallest that holds it"
    small = (await printed(board, page="A4")).json()
    assert (small["status"], small["code"]) == (422, "print-refused")
    said = {"id": "page-too-small", "params": {"page": "A4", "width_mm": 260.0, "height_mm": 200.0}}
    assert small["details"]["what"] == said
    assert (await printed("chessboard:90x60:20")).json()["details"]["what"]["params"]["page"] == "A0"
    assert (await printed(board, page="A9")).json()["details"]["what"]["id"] == "no-such-page"
    assert (await printed("carpet")).json()["code"] == "document-refused"


async def test_the_settings_that_are_there_answer_and_what_is_not_asked_stays(cell: Cell) -> None:
    bench, headers, file = cell
    first = {**ANSWERS, "tolerance": "0.5", "size": "200/10 calliper"}

    async def ask(method: str, path: str, **body: Any) -> Any:
        tag = (await bench.client.get("/setup", headers=headers["admin"])).headers["etag"]
        return await bench.client.request(method, path, json=body, headers={**headers["admin"], "If-Match": tag})

    assert (await ask("PUT", "/setup", answers=first)).status_code == 200
    file.write_text(file.read_text().replace("[robot]", "[robot]\nspeed_mm_s = 50.0") + '\n[report]\ncell = "Line 3"\n')
    there = (await bench.client.get("/setup", headers=headers["admin"])).json()["before"]
    assert there["found"] == ["what is not asked stays as it is: report"]
    assert there["answers"] == {
        "controller": CONTROLLER.address, "model": "IRB 1600-6/1.45", "camera": ANSWERS["camera"],
        "target": "chessboard:9x6:1.0", "size": "200/10 calliper", "tolerance": "0.5",
        "box": " ".join(f"{value:g}" for corner in BOX for value in corner),
    }  # fmt: skip
    dropped = (await ask("POST", "/setup/read", settings=file.read_text())).json()
    assert dropped == there
    wrong = (await ask("POST", "/setup/read", settings="[robot]\nspeed_mm_s = 9000")).json()
    assert (wrong["status"], wrong["problems"][0]["place"]) == (422, "robot.speed_mm_s")
    proposed = {**there["answers"], "controller": "10.0.0.2", "tolerance": "0.8"}
    assert (await ask("POST", "/setup/try", question="size", answers=proposed)).json()["expected_mm"]
    assert not bench.robot.goals

    assert (await ask("PUT", "/setup", answers=proposed)).status_code == 200

    settings = load_settings(file)
    assert (settings.robot.speed_mm_s, settings.report.cell) == (50.0, "Line 3")
    assert (settings.calibration.tolerance_mm, settings.target) == (0.8, Chessboard(9, 6, 20.0))
    other = '[report]\ncell = "Line 4"\n[server]\nport = 1\n'
    assert (await ask("PUT", "/setup", answers=proposed, settings=other)).status_code == 200
    settings = load_settings(file)
    assert (settings.robot.speed_mm_s, settings.report.cell) == (100.0, "Line 4")
    assert settings.server.port == bench.application.settings.server.port


@pytest.mark.parametrize("role", ["viewer", "operator"])
async def test_it_is_for_admins(cell: Cell, role: str) -> None:
    bench, headers, _ = cell
    asked = (
        ("GET", "/setup", None),
        ("GET", "/setup/target.pdf", None),
        ("PUT", "/setup", {"answers": ANSWERS}),
        ("POST", "/setup/try", {}),
        ("POST", "/setup/read", {}),
    )
    for method, path, body in asked:
        assert (await bench.client.request(method, path, json=body, headers=headers[role])).status_code == 403


async def test_a_cell_that_is_set_up_is_left_alone(cell: Cell) -> None:
    bench, headers, file = cell
    bench.application.setup_file = None
    assert (await bench.client.get("/setup", headers=headers["admin"])).json()["set_up"]
    for method, path, body in (
        ("PUT", "/setup", {"answers": ANSWERS}),
        ("POST", "/setup/try", {"question": "controller", "answers": ANSWERS}),
        ("POST", "/setup/read", {"settings": ""}),
    ):
        answer = await bench.client.request(method, path, json=body, headers={**headers["admin"], "If-Match": '"None"'})
        assert (answer.status_code, answer.json()["code"]) == (409, "setup-conflict")
    assert not file.exists()


async def test_a_browser_is_sent_to_the_set_up(cell: Cell) -> None:
    bench, headers, _ = cell
    sent = await bench.client.get("/", headers={**headers["viewer"], "Accept": "text/html"})
    assert sent.headers["Location"] == "/page/#/setup"
