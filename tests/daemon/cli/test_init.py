"""`handeyed init` at a mock cell that is a process of its own: from an empty folder to settings that work."""

import os
import re
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from typer.testing import CliRunner

from calibration.targets import Chessboard
from daemon.cli.demo_run.processes import start_child
from daemon.cli.main import app
from daemon.config.settings import load_settings
from daemon.tools.first_setup import interview
from daemon.tools.first_setup.devices import SeenCamera, take_picture
from tests.calibration.detection.sights import pictures
from tests.daemon.cli.running import Ran, handeyed

FAST = ["mock_robot", "run", "--with-parent", "--time-scale", "100"]
MAX_ANSWERS = 8


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Any]]:
    with start_child("mock", FAST, tmp_path_factory.mktemp("mock")) as mock:
        yield mock.announcement


@pytest.fixture(autouse=True, scope="module")
def one_picture_of_each_camera() -> Iterator[None]:
    """A further one differs by its noise only; to draw it and to recognise its target takes most of an interview."""
    taken: dict[str, SeenCamera] = {}

    async def take_picture_once(address: str) -> SeenCamera:
        if address not in taken:
            taken[address] = await take_picture(address)
        return taken[address]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(interview, "take_picture", take_picture_once)
        yield


def init(file: Path, *answers: str, from_file: Path | None = None) -> Ran:
    options = [] if from_file is None else ["--from", str(from_file)]
    typed = "".join(f"{answer}\n" for answer in answers)
    result = CliRunner().invoke(app, ["init", str(file), *options], input=typed)
    return Ran(result.exit_code, result.stdout, result.stderr)


def moves_of(cell: dict[str, Any]) -> int:
    return int(httpx.get(f"{cell['control']}/state").json()["moves_commanded"])


def answers_of(cell: dict[str, Any]) -> list[str]:
    """Controller, camera, where it is, the target as recognised, its size, the tolerance, the box."""
    return [cell["rws"]["1.0"], cell["camera"], "arm", "", "200/10 calliper", "", "program"]


def test_few_answers_make_settings_that_the_check_finds_well(cell: dict[str, Any], tmp_path: Path) -> None:
    file = tmp_path / "handeyed.toml"
    file.write_text("# an old one\n")

    before = moves_of(cell)

    ran = init(file, *answers_of(cell))

    assert (ran.status, ran.err) == (0, "")
    assert moves_of(cell) == before
    assert len(answers_of(cell)) <= MAX_ANSWERS
    settings = load_settings(file)
    assert settings.robot.address == f"tcp://{cell['robot']['host']}:{cell['robot']['port']}"
    assert settings.robot.model == cell["cell"]["arm"]
    assert [list(corner) for corner in settings.robot.box_mm] == cell["cell"]["box_mm"]
    described = asdict(settings.target)
    assert described == described | {key: value for key, value in cell["cell"]["target"].items() if value is not None}
    assert settings.calibration.tolerance_mm == 1.0
    assert (tmp_path / "handeyed.toml.1").read_text() == "# an old one\n"
    assert "RobotWare 6" in ran.out
    assert "616-1 PC Interface" in ran.out
    assert re.search(r"expected with 8 pictures: ± 0\.\d\d mm; less with a better arm", ran.out)
    checked = handeyed("check", file)
    assert checked.status == 0, checked.out


def test_the_address_of_a_second_daemon_is_said(
    cell: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its port is the next one, and `handeyed calibrate` without --url would move the first one's arm."""
    monkeypatch.setattr("daemon.cli.rest_client.free_port", lambda: 8373)
    ran = init(tmp_path / "handeyed.toml", *answers_of(cell))
    assert load_settings(tmp_path / "handeyed.toml").server.port == 8373
    assert "handeyed calibrate --url http://127.0.0.1:8373  # in a second terminal: THE ARM MOVES" in ran.out


def test_settings_that_are_there_are_proposed_and_kept(cell: dict[str, Any], tmp_path: Path) -> None:
    file = tmp_path / "handeyed.toml"
    assert init(file, *answers_of(cell)).status == 0
    file.write_text(file.read_text() + '\n[report]\ncell = "Line 3"\n')
    before, moves = load_settings(file), moves_of(cell)

    ran = init(file, *[""] * MAX_ANSWERS)

    assert ran.status == 0, ran.err
    assert "what is not asked stays as it is: report" in ran.out
    assert load_settings(file) == before
    other = tmp_path / "other" / "handeyed.toml"
    other.parent.mkdir()
    assert init(other, *[""] * (MAX_ANSWERS - 2), from_file=file).status == 1, "the answers end"
    assert list(other.parent.iterdir()) == []
    assert init(other, *[""] * MAX_ANSWERS, from_file=file).status == 0
    assert load_settings(other).report.cell == "Line 3"
    assert moves_of(cell) == moves
    file.write_text("[robot]\nspeed_mm_s = 9000\n")
    refused = init(other, from_file=file)
    assert (refused.status, "robot.speed_mm_s" in refused.err) == (2, True)
    assert "nothing is taken from" in init(file, *answers_of(cell)).out


def test_what_is_refused_is_asked_again(cell: dict[str, Any], tmp_path: Path) -> None:
    controller, camera, setup, target, size, tolerance, box = answers_of(cell)
    wrong = [
        "127.0.0.1:1",
        "rws://[",
        "tcp://127.0.0.1:1",
        controller,
        "video",
        camera,
        "ceiling",
        setup,
        "carpet",
        "charuco:12x9:20:15:DICT_9X9",
        target,
        "wide",
        size,
        "-1",
        tolerance,
        "0 0 0 1 1 1",
    ]

    ran = init(tmp_path / "handeyed.toml", *wrong, box)

    assert ran.status == 0
    assert ran.out.count("  ! ") == 10
    assert "robot tcp://127.0.0.1:1" in ran.out
    assert [file.name for file in tmp_path.iterdir()] == ["handeyed.toml"]


def test_a_box_is_taken_with_the_arm(cell: dict[str, Any], tmp_path: Path) -> None:
    ran = init(tmp_path / "handeyed.toml", *answers_of(cell)[:-1], "here", "0 500 0")

    assert ran.status == 0
    low, high = load_settings(tmp_path / "handeyed.toml").robot.box_mm
    assert f"flange at ({high[0]:.0f}, {low[1]:.0f}, {high[2]:.0f}) mm" in ran.out


def test_two_corners_after_one_that_was_taken_with_the_arm_are_the_box(cell: dict[str, Any], tmp_path: Path) -> None:
    """The first was one of three, and the box reached from the lowest to the highest of them."""
    ran = init(tmp_path / "handeyed.toml", *answers_of(cell)[:-1], "0 0 -4000", "0 -900 0 1400 900 1600")

    assert ran.status == 0, ran.err
    assert load_settings(tmp_path / "handeyed.toml").robot.box_mm == ((0, -900, 0), (1400, 900, 1600))


def test_a_target_that_is_wrongly_recognised_is_typed(cell: dict[str, Any], tmp_path: Path) -> None:
    controller, camera, setup, _, size, tolerance, box = answers_of(cell)

    ran = init(tmp_path / "handeyed.toml", controller, camera, setup, "chessboard:7x5:1", size, tolerance, box)

    assert ran.status == 0
    assert "  ! it is not found in the picture" in ran.out
    assert load_settings(tmp_path / "handeyed.toml").target == Chessboard(7, 5, 20.0)


def test_nothing_is_written_when_the_answers_end(cell: dict[str, Any], tmp_path: Path) -> None:
    ran = init(tmp_path / "handeyed.toml", *answers_of(cell)[:2])

    assert ran.status == 1
    assert ran.err == "the answers: they end before the last question: nothing was written\n"
    assert list(tmp_path.iterdir()) == []


def test_without_the_robot_program_the_arm_is_read_only(tmp_path: Path) -> None:
    with start_child("mock", [*FAST, "--controller", "rapid", "--serial"], tmp_path) as mock:
        announced = mock.announcement
        ran = init(tmp_path / "handeyed.toml", *answers_of(announced)[:-1], "0 -900 0 1400 900 1600")

    assert ran.status == 0, ran.err
    assert "handeyed robot setup" in ran.out
    assert load_settings(tmp_path / "handeyed.toml").robot.address.startswith("rws://")


@pytest.mark.slow
def test_the_settings_calibrate_the_cell(cell: dict[str, Any], tmp_path: Path) -> None:
    file = tmp_path / "handeyed.toml"
    assert init(file, *answers_of(cell)).status == 0
    lines = [line for line in file.read_text().splitlines() if not line.startswith(("[server]", "port"))]
    file.write_text("\n".join([*lines, "[server]", "port = 0"]))

    with start_child("daemon", ["daemon.cli", "serve", str(file)], tmp_path) as daemon:
        ran = handeyed("calibrate", "--url", daemon.announcement["url"])

    assert ran.status == 0, ran.err
    assert "accepted" in ran.out.splitlines()[0]


def test_pictures_are_taken_until_a_target_is_recognised(
    cell: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    black = np.zeros((480, 640), np.uint8)
    grey = np.random.default_rng(1).integers(90, 160, (480, 640)).astype(np.uint8)
    board = pictures(Chessboard(9, 6, 20.0), 1)[0].image
    shown = iter([black, black, grey, board])

    async def take_shown(address: str) -> SeenCamera:
        return SeenCamera(address, "", next(shown))

    monkeypatch.setattr(interview, "take_picture", take_shown)
    controller, _, setup, _, _, tolerance, box = answers_of(cell)

    ran = init(tmp_path / "handeyed.toml", controller, "video:0", setup, "", "", "", "", "20", tolerance, box)

    assert ran.status == 0, ran.err
    assert "  ! the image is black (brightest 0 of 255): check lens cap, light, exposure" in ran.out
    assert load_settings(tmp_path / "handeyed.toml").target == Chessboard(9, 6, 20.0)


@pytest.mark.parametrize("kind", ["a link", "a pipe", "a folder"])
def test_nothing_but_a_file_is_replaced_and_that_is_said_before_the_first_question(tmp_path: Path, kind: str) -> None:
    """As root, `handeyed init /dev/null` renamed the device."""
    file = tmp_path / "handeyed.toml"
    {"a link": lambda: file.symlink_to("other"), "a pipe": lambda: os.mkfifo(file), "a folder": file.mkdir}[kind]()
    before = file.lstat()
    ran = init(file)
    assert (ran.status, ran.out) == (1, "")
    assert f"{file}: cannot be written (it is a" in ran.err
    assert (file.lstat().st_ino, [*tmp_path.iterdir()]) == (before.st_ino, [file])
