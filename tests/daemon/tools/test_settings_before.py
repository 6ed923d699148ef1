"""A settings file of before: what it answers, what of it stays, and what of another cell's is left out."""

from pathlib import Path

import numpy as np
import pytest

from calibration.errors import DocumentError
from daemon.config.settings import load_settings, parse_settings
from daemon.tools.first_setup.devices import SeenCamera, SeenController
from daemon.tools.first_setup.interview import Interview
from daemon.tools.first_setup.settings_before import SettingsBefore, settings_before, write_settings

PORT = 8400
WHOLE = """
webhooks = [{ receiver = "mes", url = "https://mes/hook", secret_file = "mes.secret" }]
[robot]
address = "rws://Ann:pa%2Fss@10.0.0.2?frame=base"
stop_address = "rws://10.0.0.2"
model = "IRB 1600-6/1.45"
speed_mm_s = 250.0
base_frame = { translation_mm = [0.0, 0.0, 2500.0], quaternion_wxyz = [0.0, 1.0, 0.0, 0.0] }
box_mm = [[300, -900, 300], [1400, 900, 1600]]
[camera]
address = "http://10.0.0.3/frame.png"
setup = "eye-to-hand"
limit_s = 9.0
[target]
kind = "charuco"
columns = 12
rows = 9
square_mm = 20
marker_mm = 15.2
dictionary = "DICT_5X5_100"
[calibration]
tolerance_mm = 0.5
policy = "auto"
[calibration.known]
arm = "absolute-accuracy"
target = { source = "measured", length_mm = 200.0, instrument = "calliper" }
[scanner]
address = "http://10.0.0.4/cloud.ply"
[scanner.camera_T_scanner]
translation_mm = [1.0, 2.0, 3.0]
quaternion_wxyz = [1.0, 0.0, 0.0, 0.0]
[server]
port = 8500
[storage]
folder = "kept"
"""
ANSWERS = {
    "controller": "rws://10.0.0.2?frame=base",
    "model": "IRB 1600-6/1.45",
    "camera": "http://10.0.0.3/frame.png",
    "setup": "beside",
    "target": "charuco:12x9:1.0:0.76:DICT_5X5_100",
    "size": "200/10 15.2 calliper",
    "tolerance": "0.5",
    "box": "300 -900 300 1400 900 1600",
}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "handeyed.toml").write_text(WHOLE)
    return tmp_path / "handeyed.toml"


async def answered(
    before: SettingsBefore, controller: str = "rws://Ann:pa%2Fss@10.0.0.2?frame=base", **other: str
) -> str:
    """The file that comes of its own answers, but for the `other` ones."""
    answers = before.answers() | other
    known = before.settings.robot
    seen = SeenController(controller, (), known.model, known.base_frame, None, (500.0, 0.0, 500.0))
    asked = Interview(before=before, controller=seen, model=answers["model"])
    asked.camera = SeenCamera(answers["camera"], "", np.zeros((480, 640), np.uint8))
    for name in ("setup", "target", "size", "tolerance"):
        await asked.take(name, answers[name])
    asked.box_mm = known.box_mm
    return asked.settings_text()


async def test_its_own_answers_make_the_same_settings(file: Path) -> None:
    before = SettingsBefore.of_file(file, PORT)
    assert before.answers() == ANSWERS
    assert parse_settings((await answered(before)).encode(), "again") == parse_settings(WHOLE.encode(), "before")
    assert before.lines() == ("what is not asked stays as it is: webhooks, scanner",)


async def test_another_answer_replaces_what_it_settles_and_nothing_else(file: Path) -> None:
    text = await answered(SettingsBefore.of_file(file, PORT), target="chessboard:9x6:1", size="25", tolerance="2")
    settings = parse_settings(text.encode(), "again")
    assert settings.target.kind == "chessboard"
    assert (settings.calibration.tolerance_mm, settings.calibration.policy) == (2.0, "auto")
    assert settings.calibration.known.target.source == "printed"
    assert settings.calibration.known.arm == "absolute-accuracy"


async def test_a_certificate_stays_while_the_size_is_the_same() -> None:
    certified = WHOLE.replace('"measured"', '"certified"').replace('instrument = "calliper"', "uncertainty_mm = 0.01")
    before = SettingsBefore().with_answers_of(certified.encode(), "dropped.toml")
    assert before.answers()["size"] == "20 15.2"
    kept = parse_settings((await answered(before)).encode(), "again").calibration.known.target
    assert (kept.source, kept.uncertainty_mm) == ("certified", 0.01)
    other = parse_settings((await answered(before, size="21 16")).encode(), "again").calibration.known.target
    assert other.source == "printed"


async def test_another_robot_is_not_stopped_at_the_address_of_the_first_one(file: Path) -> None:
    before = SettingsBefore.of_file(file, PORT)
    robot = parse_settings((await answered(before, controller="rws://10.0.0.9")).encode(), "again").robot
    assert (robot.stop_address, robot.speed_mm_s) == (None, 250.0)


async def test_passwords_are_not_shown_and_stay(file: Path) -> None:
    before = SettingsBefore.of_file(file, PORT)
    assert "pa%2Fss" not in str(before.answers()) + str(before.lines())
    assert before.with_password(ANSWERS["controller"]) == "rws://Ann:pa%2Fss@10.0.0.2?frame=base"
    assert before.with_password("10.0.0.2") == "10.0.0.2"


async def test_of_another_cells_file_the_daemons_address_and_store_are_left_out(file: Path, tmp_path: Path) -> None:
    here = tmp_path / "new" / "handeyed.toml"
    before = SettingsBefore.of_file(here, PORT).with_answers_of(WHOLE.encode(), "dropped.toml")
    settings = parse_settings((await answered(before)).encode(), "again")
    assert (settings.server.port, settings.storage.folder) == (PORT, "store")
    over = SettingsBefore.of_file(file, PORT).with_answers_of(b"[server]\nport = 1\n", "dropped.toml")
    assert (over.answers(), over.settings.server.port) == ({}, 8500)
    with pytest.raises(DocumentError, match=r"dropped\.toml: robot\.speed_mm_s"):
        SettingsBefore().with_answers_of(b"[robot]\nspeed_mm_s = 9000\n", "dropped.toml")


@pytest.mark.parametrize(
    ("content", "words"),
    [("robot = 3", "robot"), ("[robot", "not TOML"), ("[robot]\nspeed = 1", "speed"), ("", "")],
    ids=["no table", "no TOML", "unknown key", "empty"],
)
def test_a_file_that_cannot_be_read_answers_nothing_and_says_why(tmp_path: Path, content: str, words: str) -> None:
    file = tmp_path / "handeyed.toml"
    file.write_text(content)
    before = SettingsBefore.of_file(file, PORT)
    assert before.answers() == {}
    assert words in before.problem


def test_a_daemon_that_sets_up_has_the_address_and_the_keys_of_the_file_that_is_there(file: Path) -> None:
    settings = settings_before(file, PORT)
    assert settings.server.port == 8500
    assert settings.storage.folder == str(file.parent / "kept")
    assert (settings.robot.address, settings.scanner) == ("tcp://127.0.0.1:9", None)
    fresh = settings_before(file.with_name("none.toml"), PORT)
    assert (fresh.server.port, fresh.storage.folder) == (PORT, str(file.parent / "store"))


async def test_the_new_file_is_loaded_with_what_stays(file: Path) -> None:
    loaded = load_settings(file)
    write_settings(file, await answered(SettingsBefore.of_file(file, PORT)))
    assert load_settings(file) == loaded
