"""Read a file up to MAX_BYTES; refuses devices and pipes, which may never end."""

import errno
import os
from pathlib import Path

from calibration.errors import DocumentError, DocumentProblem

MAX_BYTES = 256_000_000
"""256 MB: documents and pictures are far smaller."""


def read_bounded(file: Path) -> bytes:
    """The content of `file`. Raises OSError, also (EFBIG) when it is longer than MAX_BYTES."""
    with file.open("rb") as opened:
        content = opened.read(MAX_BYTES + 1)
    if len(content) > MAX_BYTES:
        raise OSError(errno.EFBIG, os.strerror(errno.EFBIG), str(file))
    return content


def read_document(file: Path) -> bytes:
    """The content of `file`. Raises DocumentError for an OSError."""
    try:
        return read_bounded(file)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        problem = DocumentProblem("file", reason, "check the path and its permissions")
        raise DocumentError(str(file), [problem]) from None
