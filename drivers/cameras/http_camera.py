"""A camera that serves its image at a URL."""

import asyncio

from drivers.cameras.decoding import decode, file_bits
from drivers.http_source import HttpSource
from drivers.interfaces import CameraFrame, CaptureSettings


class HttpCamera(HttpSource):
    """drivers.interfaces.Camera. The response may state an image's age; otherwise it was taken after the request.

    It may state the camera's temperature, too.
    """

    kind, limit_s, max_bytes = "camera", 5.0, 64 * 2**20

    async def grab(self, newer_than_s: float) -> CameraFrame:
        """An image taken after `newer_than_s`; raises a DeviceError."""
        fetched = await self.fetch(newer_than_s)
        image = await asyncio.to_thread(decode, self.device, fetched.content, self._image_size)
        temperature_c = fetched.temperature_c
        capture = (
            None if temperature_c is None else CaptureSettings(file_bits(fetched.content), temperature_c=temperature_c)
        )
        return CameraFrame(image, fetched.taken_at_s, fetched.content, capture)
