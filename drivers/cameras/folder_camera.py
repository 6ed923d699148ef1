"""A camera that writes its images to a folder."""

from drivers.cameras.decoding import decode
from drivers.interfaces import CameraFrame
from drivers.watched_folder import WatchedFolder


class FolderCamera(WatchedFolder):
    """drivers.interfaces.Camera. An image is as old as its file plus `lag_s` for exposure and writing."""

    kind, suffixes, limit_s, max_bytes = "camera", (".png", ".jpg", ".jpeg"), 5.0, 64 * 2**20

    async def grab(self, newer_than_s: float) -> CameraFrame:
        """The newest complete image from after `newer_than_s`; raises a DeviceError."""
        image, encoded, taken_at_s = await self.newest(
            newer_than_s, lambda device, content: decode(device, content, self._image_size)
        )
        return CameraFrame(image, taken_at_s, encoded)
