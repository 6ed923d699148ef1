"""A whole calibration over GigE Vision: aravis's camera on loopback sends what the mock cell's camera would see."""

from pathlib import Path

import pytest

from tests.mock_robot.running_cell import running_cell
from tests.stories.plant import small_pictures
from tests.stories.vendor_camera import calibrate_and_register
from tests.support.vendor_cameras import SERIAL, gigabit_scene

pytestmark = pytest.mark.slow

SEED = 7


async def test_a_calibration_over_gige_vision(tmp_path: Path) -> None:
    truth = small_pictures(SEED)
    width, height = truth.camera.image_size
    async with running_cell(SEED, 100.0, truth=truth) as cell:
        with gigabit_scene(f"{cell.announcement.devices_url}/camera/snapshot.png"):
            address = f"aravis:{SERIAL}?Width={width}&Height={height}"
            found = await calibrate_and_register(cell, truth, address, tmp_path)
    assert found.exposure_us == 10_000.0
