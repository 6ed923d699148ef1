"""XYZ and CSV: one point per line. A first line of words names the columns; the default is x, y, z, c3, c4, ...

Six columns without names whose last three are whole numbers of a byte, not all 0 or 1, are x, y, z, red, green, blue.
"""

import re

import numpy as np

from registration.errors import CloudFormatError
from registration.io.formats.header import HEADER_LIMIT, CloudHeader, shorten
from registration.points.layout import COLOURS, Layout

COLUMN_LIMIT = 256
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?nan|[+-]?inf(inity)?", re.IGNORECASE)
SYNONYMS = {"r": "red", "g": "green", "b": "blue", "i": "intensity"}


def parse_header(prefix: bytes, file: str) -> CloudHeader | None:
    """Column names; None while the first line is incomplete. Raises CloudFormatError."""
    end = prefix.find(b"\n")
    if end < 0:
        if len(prefix) > HEADER_LIMIT:
            raise CloudFormatError(file, "line 1", f"it is longer than {HEADER_LIMIT} bytes", "check the file's type")
        return None
    try:
        line = prefix[:end].decode("utf-8-sig").strip()
    except UnicodeDecodeError:
        raise CloudFormatError(file, "line 1", "it is not text", "check the file's type") from None
    separator = next((mark for mark in (",", ";", "\t") if mark in line), None)
    words = line.lstrip("#/ ").split(separator)
    named = not all(NUMBER.fullmatch(word.strip()) for word in words)
    unnamed = [*"xyz", *(f"c{index}" for index in range(3, len(words)))][: len(words)]
    plain = [word.strip().strip('"').strip().lower() for word in words]
    names = [SYNONYMS.get(name, name) for name in plain] if named else unnamed
    if not named and len(names) == 6 and are_bytes(prefix[: prefix.rfind(b"\n")].decode("ascii", "replace"), separator):
        names[3:] = COLOURS
    if not {"x", "y", "z"} <= set(names) or len(set(names)) != len(names) or len(names) > COLUMN_LIMIT:
        what = f"{shorten(line)} names no columns x, y, z (once each), nor is it numbers"
        raise CloudFormatError(file, "line 1", what, "write a first line such as 'x,y,z' or numbers only")
    length = end + 1 if named else 0
    layout = Layout.of(np.dtype([(name, "<f8") for name in names]))
    return CloudHeader("rows", "text", layout, None, length, prefix[:length], separator=separator)


def are_bytes(lines: str, separator: str | None) -> bool:
    words = [word.strip() for line in lines.splitlines() for word in line.split(separator)[3:]]
    numbers = [int(word) if word.isdecimal() and len(word) < 4 else 256 for word in words]
    return 1 < max(numbers, default=0) < 256


def format_header(layout: Layout, separator: str) -> bytes:
    return (separator.join(layout.dtype.names or ()) + "\n").encode("ascii")
