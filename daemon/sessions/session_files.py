"""The files of a session folder: session.json, and one picture a view."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.errors import ErrorWithFix
from daemon.runtime.bounded_read import read_bounded
from drivers.cameras.decoding import is_truncated, without_orientation
from drivers.cameras.pixel_depth import to_8_bit

SESSION_FILE = "session.json"
GREY = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
TAKE_AGAIN = "take the picture again, or remove the view from session.json"


class ImageError(ErrorWithFix):
    """A view's picture cannot be used; `what` is wrong and `fix` says what to do."""


def read_grey(file: Path) -> NDArray[np.uint8]:
    """The picture in `file` as uint8 (h, w); of 16-bit grey levels the bits in use, scaled. Raises ImageError."""
    return to_8_bit(read_levels(file))


def find_grey(file: Path) -> NDArray[np.uint8] | None:
    """The picture as `read_grey` reads it; None when it is gone or cannot be read."""
    try:
        return read_grey(file)
    except (ImageError, OSError):
        return None


def read_levels(file: Path) -> NDArray[Any]:
    """The grey levels (h, w) in `file`: uint16 when it holds more than 8 bits, else uint8. Raises ImageError."""
    try:
        content = read_bounded(file)
    except FileNotFoundError:
        raise ImageError(f"'{file.name}' is not there", "restore the file, or remove the view") from None
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise ImageError(f"'{file.name}' cannot be read ({reason})", "check its permissions") from None
    if not content:
        raise ImageError(f"'{file.name}' is empty (0 bytes)", TAKE_AGAIN)
    if is_truncated(content):
        raise ImageError(f"'{file.name}' is cut off or damaged", TAKE_AGAIN)
    image = _decode(content, GREY | cv2.IMREAD_ANYDEPTH)
    if image is not None and image.dtype not in (np.uint8, np.uint16):
        image = _decode(content, GREY)  # floating point, or signed
    if image is None:
        raise ImageError(f"'{file.name}' is not a picture", TAKE_AGAIN)
    return image


def _decode(content: bytes, flags: int) -> NDArray[Any] | None:
    try:
        image = cv2.imdecode(np.frombuffer(without_orientation(content), np.uint8), flags)
    except cv2.error:
        return None
    return None if image is None else np.asarray(image)
