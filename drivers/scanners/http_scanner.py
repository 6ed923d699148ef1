"""A scanner that serves a cloud file at a URL."""

import asyncio

from drivers.errors import GarbledAnswer
from drivers.http_source import HttpSource
from drivers.interfaces import ScannedCloud
from drivers.scanners.cloud_files import whole_cloud

PICTURES_AND_PAGES = ("text/html", "image/")


class HttpScanner(HttpSource):
    """drivers.interfaces.Scanner. The response may state a cloud's age; otherwise it was scanned after the request."""

    kind, max_bytes = "scanner", 2**30
    limit_s = 60.0  # a structured-light scan of one view takes seconds, its transfer as long

    async def scan(self, newer_than_s: float) -> ScannedCloud:
        """A cloud scanned after `newer_than_s`; raises a DeviceError."""
        fetched = await self.fetch(newer_than_s)
        if fetched.media_type.startswith(PICTURES_AND_PAGES):
            what = f"it answered with {fetched.media_type}, not with a cloud"
            raise GarbledAnswer(self.device, what, "check the URL")
        media_type = await asyncio.to_thread(whole_cloud, self.device, fetched.content)
        return ScannedCloud(fetched.content, media_type, fetched.taken_at_s)
