"""The settings of the robot's program beside ours: each difference with what to do about it."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.documents.validation import validate_document
from calibration.transforms import transform
from daemon.cli.checks import check_robot, setup_problems
from daemon.config.robot_settings import LoadSettings
from daemon.config.settings import RobotSettings, Settings
from drivers.interfaces import RobotSetup
from drivers.registry import open_robot
from mock_robot.cabinet.cabinet import Mounting
from tests.mock_robot.rws_cell import rws_cell
from tests.support.waiting import eventually

SETUP = RobotSetup(1.5, (0.0, 0.0, 60.0), 400.0, 1000.0, 270.0, ((-1600.0, -1600.0, 0.0), (1600.0, 1600.0, 2200.0)))
ROBOT = RobotSettings(
    address="tcp://192.168.125.1:4242",
    box_mm=((300.0, -900.0, 300.0), (1400.0, 900.0, 1600.0)),
    load=LoadSettings(mass_kg=1.5, centre_mm=(0.0, 0.0, 60.0)),
    carried_mm=((100.0, 0.0, 200.0),),
)

SECTIONS = {
    "robot": {"address": "rws://127.0.0.1", "box_mm": ROBOT.box_mm},
    "camera": {"address": "folder:."},
    "target": {"kind": "chessboard", "columns": 7, "rows": 9, "pitch_mm": 20.0},
}


@pytest.mark.parametrize(
    ("setup", "robot", "what", "fix"),
    [
        (replace(SETUP, load_kg=0.001), {"load": None}, "1 gram of tool0", "LoadIdentify"),
        (replace(SETUP, load_kg=4.0), {}, "that of [robot.load] is 1.5 kg", "LoadIdentify"),
        (replace(SETUP, load_centre_mm=(0.0, 0.0, 160.0)), {}, "its centre 100 mm away", "LoadIdentify"),
        (
            SETUP,
            {"carried_mm": ((0.0, 300.0, 400.0),)},
            "500 mm from the flange, cell_reach is 400 mm",
            "raise cell_reach",
        ),
        (replace(SETUP, speed_max_mm_s=50.0), {}, "speed_mm_s is 100", "cell_speed_max"),
    ],
)
def test_a_difference_is_named_with_a_remedy(setup: RobotSetup, robot: dict[str, object], what: str, fix: str) -> None:
    ((found, remedy),) = setup_problems(setup, ROBOT.model_copy(update=robot))
    assert what in found
    assert fix in remedy


def test_a_program_with_our_settings_has_none() -> None:
    assert list(setup_problems(SETUP, ROBOT)) == []


@pytest.mark.parametrize("frame", ["wobj", "base"])
async def test_a_base_frame_that_the_settings_lack_is_given_as_a_setting(frame: str) -> None:
    """Over a link that gives poses in the base frame it does not matter."""
    async with rws_cell() as cell:
        cell.cell.controller.mounting = Mounting(transform(np.diag([1.0, -1.0, -1.0]), [0.0, 0.0, 2500.0]))
        robot = open_robot(f"{cell.rws(1)}?frame={frame}")
        try:
            await eventually(lambda: robot.link.connected)
            found = await check_robot(robot, validate_document(Settings, SECTIONS, "settings"))
        finally:
            await robot.close()
    assert found.ok is (frame == "base"), found
    if not found.ok:
        assert "2500 mm and 180.0 deg" in found.what
        assert "translation_mm = [0.000, 0.000, 2500.000]" in found.fix
