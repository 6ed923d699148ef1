"""A GenICam 3D camera: organised clouds, with an intensity where the camera sends one."""

import asyncio
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.cameras.genicam.opened_device import GenICamDevice
from drivers.cameras.genicam.scan3d import RangeImage
from drivers.cameras.genicam.session import CameraSession
from drivers.errors import AnswerTooLarge, NothingMeasured
from drivers.interfaces import ScannedCloud
from drivers.scanners.cloud_files import EMPTY_FIX
from registration.io.formats.pcd import format_header
from registration.points.layout import Layout


class GenICamScanner(GenICamDevice):
    """drivers.interfaces.Scanner and IdentifiedDevice. Each cloud is exposed after it was asked for."""

    kind, limit_s = "scanner", 60.0

    async def scan(self, newer_than_s: float) -> ScannedCloud:
        """A cloud exposed after `newer_than_s`, as PCD in mm with width and height; raises a DeviceError."""
        image = await self._take_new(newer_than_s, CameraSession.take_cloud)
        if not np.isfinite(image.points_mm[..., 2]).any():
            raise NothingMeasured(self.device, "the cloud has no points", EMPTY_FIX)
        content = await asyncio.to_thread(organised_pcd, image)
        if len(content) > self._max_bytes:
            raise AnswerTooLarge(self.device, f"more than {self._max_bytes} bytes", "set a smaller region of interest")
        return ScannedCloud(content, "application/x-pcd", image.taken_at_s)


def organised_pcd(image: RangeImage) -> bytes:
    """PCD 0.7 with a point for every pixel, row by row: x, y, z in mm, NaN for none, and intensity if there is one."""
    height, width = image.points_mm.shape[:2]
    columns: list[NDArray[Any]] = [image.points_mm]
    names = ["x", "y", "z"]
    if image.intensity is not None:
        grey = image.intensity
        if grey.ndim == 3:
            grey = np.asarray(cv2.cvtColor(grey[..., :3], cv2.COLOR_BGR2GRAY))
        columns.append(grey[..., np.newaxis].astype(np.float32))
        names.append("intensity")
    layout = Layout.of(np.dtype([(name, "<f4") for name in names]))
    header = format_header(layout, height * width, rows=height)
    return header + np.concatenate(columns, axis=2).astype("<f4").tobytes()
