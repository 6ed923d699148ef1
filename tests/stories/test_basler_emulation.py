"""A whole calibration through pylon's own API: its emulated camera shows what the mock cell's camera would see."""

import asyncio
import urllib.request
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.transforms import map_points
from drivers import registry
from drivers.cameras.basler_camera import OpenPylonCamera, PylonLibrary
from drivers.cameras.genicam.address import parse_camera_address
from drivers.cameras.genicam.camera import GenICamCamera
from drivers.cameras.genicam.device import FoundCamera
from mock_robot.truth.score import score_calibration
from tests.daemon.clouds import PLY
from tests.daemon.fakes import ply_of, points_of
from tests.mock_robot.running_cell import running_cell
from tests.stories.plant import daemon_for, poses_taught_for, small_pictures
from tests.support.vendor_cameras import require_pylon
from tests.support.waiting import LIMIT_S

pytestmark = pytest.mark.slow

SEED = 7
POINT_MM = 0.4


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
        settings = {"camera": {"address": address}, "calibration": {"poses": poses_taught_for(SEED)[:5]}}
        async with daemon_for(cell, tmp_path / "store", **settings) as story:
            run = (await story.operator.client.post("/calibrate", params={"wait": LIMIT_S})).json()
            assert run["state"] == "finished", run["cause"]
            document = (await story.application.store.current())[1].document
            look = (await story.operator.client.get("/camera/look")).json()
            points = np.array([[0.0, 0, 600], [50, -20, 580], [-80, 40, 620]])
            answer = await story.operator.client.post(
                "/register", params={"pose": "now"}, content=ply_of(points), headers=PLY
            )
            expected = map_points(cell.cell.flange_now().base_T_flange @ truth.mount_T_scanner, points)
            off_mm = np.linalg.norm(points_of(answer.content) - expected, axis=1)
    assert document.mount_T_camera is not None
    point_mm = score_calibration(truth, document.mount_T_camera.transform())["point_rms_mm"]
    print("story: a point off by", round(point_mm, 3), "mm RMS, registered ones by", off_mm.round(3), "mm")
    assert point_mm < POINT_MM
    assert off_mm.max() < 2 * POINT_MM
    assert look["exposure_us"] > 0
