"""Read a file up to MAX_BYTES; refuses devices and pipes, which may never end."""

from pathlib import Path

from calibration.errors import DocumentError, DocumentProblem
from registration.io.regular_file import read_regular

MAX_BYTES = 256_000_000
"""256 MB: documents and pictures are far smaller."""


def read_bounded(file: Path) -> bytes:
    """The content of `file`. Raises OSError, also (EFBIG) when it is longer than MAX_BYTES or no regular file."""
    return read_regular(file, MAX_BYTES)


def read_document(file: Path) -> bytes:
    """The content of `file`. Raises DocumentError for an OSError."""
    try:
        return read_bounded(file)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        problem = DocumentProblem("file", reason, "check the path and its permissions")
        raise DocumentError(str(file), [problem]) from None
