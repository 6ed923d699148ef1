"""Cameras that serve an image at a URL, or write their images to a folder."""

import asyncio

from drivers.cameras.decoding import decode, file_bits
from drivers.http_source import NO_QUERY, Fetched, HttpSource
from drivers.interfaces import CameraFrame, CaptureSettings
from drivers.watched_folder import WatchedFolder


class HttpCamera(HttpSource):
    """drivers.interfaces.Camera. The response may state an image's age; otherwise it was taken after the request.

    It may state the camera's temperature, too.
    """

    kind, limit_s, max_bytes = "camera", 5.0, 64 * 2**20
    _scales_by: str | None = None

    async def grab(self, newer_than_s: float) -> CameraFrame:
        return await self._frame(await self.fetch(newer_than_s), self._image_size)

    async def preview(self, newer_than_s: float, width: int) -> CameraFrame:
        """As `grab`, of about that width where an answer named the parameter for it in X-Scales-By."""
        query = {self._scales_by: str(width)} if self._scales_by else NO_QUERY
        return await self._frame(await self.fetch(newer_than_s, query), None)

    async def _frame(self, fetched: Fetched, image_size: tuple[int, int] | None) -> CameraFrame:
        self._scales_by = fetched.scales_by
        image = await asyncio.to_thread(decode, self.device, fetched.content, image_size)
        temperature_c = fetched.temperature_c
        capture = (
            None if temperature_c is None else CaptureSettings(file_bits(fetched.content), temperature_c=temperature_c)
        )
        return CameraFrame(image, fetched.taken_at_s, fetched.content, capture)


class FolderCamera(WatchedFolder):
    """drivers.interfaces.Camera. An image is as old as its file plus `lag_s` for exposure and writing."""

    kind, suffixes, limit_s, max_bytes = "camera", (".png", ".jpg", ".jpeg"), 5.0, 64 * 2**20

    async def grab(self, newer_than_s: float) -> CameraFrame:
        """The newest complete image from after `newer_than_s`; raises a DeviceError."""
        image, encoded, taken_at_s = await self.newest(
            newer_than_s, lambda device, content: decode(device, content, self._image_size)
        )
        return CameraFrame(image, taken_at_s, encoded)
