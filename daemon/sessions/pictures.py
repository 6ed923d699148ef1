"""Pictures in the sizes and formats of a screen: of the camera, shared by all who ask, and of stored views."""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from daemon.errors import NotFound, PictureUnusable
from daemon.runtime.shared_reading import RecentReading
from daemon.runtime.workers import Workers
from daemon.sessions.session_files import ImageError, read_grey
from drivers.interfaces import CameraFrame, CaptureSettings

PictureType = Literal["image/png", "image/jpeg", "image/webp"]
Width = Literal[240, 480, 960, 1920]

MAX_AGE_S = 0.5
"""Age up to which a frame is given again: screens cost the camera two pictures a second, however many there are."""

_ENCODINGS: dict[PictureType, tuple[str, tuple[int, ...]]] = {
    "image/png": (".png", (cv2.IMWRITE_PNG_COMPRESSION, 1)),
    "image/jpeg": (".jpg", (cv2.IMWRITE_JPEG_QUALITY, 80)),
    "image/webp": (".webp", (cv2.IMWRITE_WEBP_QUALITY, 75)),
}


def encode_picture(image: NDArray[Any], media_type: PictureType, width: int | None) -> bytes:
    """`image` (h, w) or (h, w, 3), made `width` pixels wide if it is wider, in that format. Raises PictureUnusable."""
    height_now, width_now = image.shape[:2]
    if width is not None and width < width_now:
        size = (width, max(1, round(height_now * width / width_now)))
        image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA))
    suffix, options = _ENCODINGS[media_type]
    done, content = cv2.imencode(suffix, image, options)
    if not done:
        raise PictureUnusable(f"the picture cannot be encoded as {media_type}", "ask for image/png")
    return bytes(np.asarray(content, np.uint8).data)


def encode_file(file: Path, media_type: PictureType, width: int | None) -> bytes:
    """The stored picture in that size and format. Raises NotFound, PictureUnusable."""
    if not file.is_file():
        raise NotFound.file(file)
    try:
        return encode_picture(read_grey(file), media_type, width)
    except ImageError as error:
        raise PictureUnusable(error.what, error.fix) from None


@dataclass(frozen=True)
class LivePicture:
    """An encoded picture, and what the camera reports of it."""

    content: bytes
    capture: CaptureSettings | None


class LivePictures:
    """What the camera sees: one grab and one encoding for all who ask within MAX_AGE_S."""

    def __init__(
        self, read_frame: Callable[[], Awaitable[CameraFrame]], workers: Workers, monotonic_s: Callable[[], float]
    ) -> None:
        self.frame = RecentReading(read_frame, monotonic_s, MAX_AGE_S)
        self._workers, self._monotonic_s = workers, monotonic_s
        self._encoded: dict[tuple[PictureType, Width | None], RecentReading[LivePicture]] = {}

    async def read(self, media_type: PictureType, width: Width | None) -> LivePicture:
        """The picture as a file of that format. Raises DeviceError, PictureUnusable."""

        async def encode() -> LivePicture:
            frame = await self.frame.read()
            content = await self._workers.run(encode_picture, frame.image, media_type, width)
            return LivePicture(content, frame.capture)

        key = media_type, width
        reading = self._encoded.setdefault(key, RecentReading(encode, self._monotonic_s, MAX_AGE_S))
        return await reading.read()
