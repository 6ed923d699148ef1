"""A whole calibration through pylon's own API: its emulated camera shows what the mock cell's camera would see."""

import asyncio
import urllib.request
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from drivers import registry
from drivers.cameras.basler_camera import OpenPylonCamera, PylonLibrary
from drivers.cameras.genicam.address import parse_camera_address
from drivers.cameras.genicam.device import FoundCamera
from drivers.cameras.genicam.opened_device import GenICamCamera
from tests.mock_robot.running_cell import running_cell
from tests.stories.plant import small_pictures
from tests.stories.vendor_camera import calibrate_and_register
from tests.support.vendor_cameras import require_pylon
from tests.support.waiting import LIMIT_S

pytestmark = pytest.mark.slow

SEED = 7


class CellBeforePylon(PylonLibrary):
    """pylon; the emulated camera's file shows the cell's view from before each stream, at whose start it is read."""

    def __init__(self, url: str, file: Path) -> None:
        self._url, self._file = url, file

    def open(self, camera: FoundCamera) -> OpenPylonCamera:
        opened = super().open(camera)
        start_stream = opened.start_stream

        def show_and_start() -> None:
            self.show()
            start_stream()

        vars(opened)["start_stream"] = show_and_start
        return opened

    def show(self) -> None:
        """Write what the cell's camera sees now."""
        with urllib.request.urlopen(self._url, timeout=LIMIT_S) as answer:
            fresh = self._file.with_suffix(".new.png")
            fresh.write_bytes(answer.read())
        fresh.rename(self._file)


async def test_a_calibration_with_pylons_emulation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    require_pylon(monkeypatch)
    file = tmp_path / "seen.png"
    truth = small_pictures(SEED)
    width, height = truth.camera.image_size
    size, source = f"Width={width}&Height={height}", f"TestImageSelector=Off&ImageFilename={file}&ImageFileMode=On"
    address = f"basler:0815-0000?{size}&{source}&trigger=off"
    async with running_cell(SEED, 100.0, truth=truth) as cell:
        library = CellBeforePylon(f"{cell.announcement.devices_url}/camera/snapshot.png", file)
        await asyncio.to_thread(library.show)
        open_camera: Any = partial(GenICamCamera, lambda address: library)
        monkeypatch.setitem(registry.CAMERAS, "basler", (parse_camera_address, open_camera))
        found = await calibrate_and_register(cell, truth, address, tmp_path / "store")
    assert found.exposure_us is not None and found.exposure_us > 0
