"""The files of a session folder: session.json, and one picture a view."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from daemon.runtime.bounded_read import read_bounded
from drivers.cameras.decoding import is_truncated

SESSION_FILE = "session.json"
TAKE_AGAIN = "take the picture again, or remove the view from session.json"


class ImageError(Exception):
    """A view's picture cannot be used; `what` is wrong and `fix` says what to do."""

    def __init__(self, what: str, fix: str) -> None:
        self.what, self.fix = what, fix
        super().__init__(f"{what}: {fix}")


def read_grey(file: Path) -> NDArray[np.uint8]:
    """The picture in `file` as uint8 (h, w). Raises ImageError."""
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
    try:
        image = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION)
    except cv2.error:
        image = None
    if image is None:
        raise ImageError(f"'{file.name}' is not a picture", TAKE_AGAIN)
    return np.asarray(image, np.uint8)
