"""A whole calibration through a GenTL producer: the buffers are those of EMVA's viky.cti, the pixels the cell's.

viky draws a picture of its own and takes none, so the driver's copy of each buffer gets the mock cell's view.
"""

import urllib.request
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from drivers import registry
from drivers.cameras.genicam.address import parse_camera_address
from drivers.cameras.genicam.device import FoundCamera, RawPicture
from drivers.cameras.genicam.opened_device import GenICamCamera
from drivers.cameras.genicam_camera import HarvestersLibrary, OpenGenTLCamera
from tests.mock_robot.running_cell import running_cell
from tests.stories.plant import small_pictures
from tests.stories.vendor_camera import calibrate_and_register
from tests.support.vendor_cameras import viky
from tests.support.waiting import LIMIT_S

pytestmark = pytest.mark.slow

SEED = 7
BY = 2.4
"""viky's picture is at most 800 pixels wide."""


class CellBeforeViky(HarvestersLibrary):
    """harvesters; each picture shows the cell's view at the moment at which its buffer has come."""

    def __init__(self, producer: Path, url: str) -> None:
        super().__init__(str(producer))
        self._url = url

    def open(self, camera: FoundCamera) -> OpenGenTLCamera:
        opened = super().open(camera)
        next_picture = opened.next_picture

        def picture_of_the_cell(limit_s: float) -> RawPicture | None:
            picture = next_picture(limit_s)
            if picture is None:
                return None
            pixels = self.pixels((picture.height, picture.width))
            return replace(picture, data=np.concatenate([pixels, picture.data[pixels.size :]]))

        vars(opened)["next_picture"] = picture_of_the_cell
        return opened

    def pixels(self, shape: tuple[int, int]) -> NDArray[np.uint8]:
        """What the cell's camera sees now, row by row."""
        with urllib.request.urlopen(self._url, timeout=LIMIT_S) as answer:
            image = cv2.imdecode(np.frombuffer(answer.read(), np.uint8), cv2.IMREAD_GRAYSCALE)
        assert image is not None and image.shape == shape
        return np.asarray(image, np.uint8).ravel()


async def test_a_calibration_through_a_gentl_producer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    truth = small_pictures(SEED, BY)
    producer, (width, height) = viky(), truth.camera.image_size
    async with running_cell(SEED, 100.0, truth=truth) as cell:
        library = CellBeforeViky(producer, f"{cell.announcement.devices_url}/camera/snapshot.png")
        open_camera: Any = partial(GenICamCamera, lambda address: library)
        monkeypatch.setitem(registry.CAMERAS, "genicam", (parse_camera_address, open_camera))
        address = f"genicam:1?producer={producer}&pixel_format=Mono8&Width={width}&Height={height}"
        await calibrate_and_register(cell, truth, address, tmp_path)
