"""A camera that writes its images to a folder."""

import time
from collections.abc import Callable
from pathlib import Path

from drivers.cameras.decoding import decode
from drivers.interfaces import CameraFrame
from drivers.timing import Timing
from drivers.watched_folder import LAG_S, WatchedFolder

LIMIT_S = 5.0
MAX_BYTES = 64 * 2**20
SUFFIXES = (".png", ".jpg", ".jpeg")


class FolderCamera(WatchedFolder):
    """drivers.interfaces.Camera. An image is as old as its file plus `lag_s` for exposure and writing."""

    def __init__(
        self,
        folder: Path,
        timing: Timing | None = None,
        *,
        image_size: tuple[int, int] | None = None,
        limit_s: float = LIMIT_S,
        max_bytes: int = MAX_BYTES,
        lag_s: float = LAG_S,
        wall_clock: Callable[[], float] = time.time,
        name: str = "camera",
    ) -> None:
        self._image_size = image_size
        super().__init__(
            folder,
            SUFFIXES,
            timing or Timing(),
            name=name,
            limit_s=limit_s,
            max_bytes=max_bytes,
            lag_s=lag_s,
            wall_clock=wall_clock,
        )

    async def grab(self, newer_than_s: float) -> CameraFrame:
        """The newest complete image from after `newer_than_s`; raises a DeviceError."""
        image, encoded, taken_at_s = await self.newest(
            newer_than_s, lambda device, content: decode(device, content, self._image_size)
        )
        return CameraFrame(image, taken_at_s, encoded)
