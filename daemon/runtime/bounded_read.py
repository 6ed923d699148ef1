"""Read a file up to MAX_BYTES; refuses devices and pipes, which may never end."""

from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel

from calibration.documents.validation import parse_document
from calibration.errors import DocumentError
from registration.io.regular_file import read_regular

Model = TypeVar("Model", bound=BaseModel)

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
        raise DocumentError.one(str(file), "file", reason, "check the path and its permissions") from None


def read_as(model: type[Model], file: Path) -> Model:
    """The document in a JSON file. Raises DocumentError."""
    return parse_document(model, read_document(file), str(file))
