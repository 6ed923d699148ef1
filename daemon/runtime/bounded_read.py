"""Files that somebody names, read whole, but not without end: a device named by mistake never ends."""

import errno
import os
from pathlib import Path

LIMIT_BYTES = 256_000_000
"""No document or picture comes near it."""


def read_whole(file: Path) -> bytes:
    """Its content. Raises OSError, also when there is more than `LIMIT_BYTES`."""
    with file.open("rb") as opened:
        content = opened.read(LIMIT_BYTES + 1)
    if len(content) > LIMIT_BYTES:
        raise OSError(errno.EFBIG, os.strerror(errno.EFBIG), str(file))
    return content
