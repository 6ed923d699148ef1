"""PCD headers (Point Cloud Library, file format v0.7; v0.5 and v0.6 differ by what may be absent)."""

import re
from typing import Any

import numpy as np

from registration.errors import CloudFormatError
from registration.io.formats.header import HEADER_LIMIT, CloudHeader, Encoding, HeaderLines, shorten
from registration.points.layout import Layout

KEYWORDS = ("VERSION", "FIELDS", "COLUMNS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA")
TYPES = {("F", 4), ("F", 8), *((kind, size) for kind in "IU" for size in (1, 2, 4, 8))}
ENCODINGS: dict[str, Encoding] = {"ascii": "text", "binary": "binary", "binary_compressed": "compressed"}
RECORD_LIMIT = 1 << 20
ORIGIN = b"VIEWPOINT 0 0 0 1 0 0 0"
"""Viewpoint of a moved cloud: its points are in the base frame, so no viewer may move them again."""


def parse_header(prefix: bytes, file: str) -> CloudHeader | None:
    """Parse the header at the start of `prefix`; None while incomplete. Raises CloudFormatError, CloudUnsupported."""
    lines = HeaderLines(file)
    entries: dict[str, list[str]] = {}
    position = 0
    rewritten: list[bytes] = []
    while "DATA" not in entries:
        end = prefix.find(b"\n", position)
        if end < 0 or end >= HEADER_LIMIT:
            # Refuse bytes that cannot begin a PCD header as early as possible.
            start = prefix[position : position + 10]
            known = any(keyword.encode().startswith(start.split(b" ")[0]) for keyword in KEYWORDS)
            if lines.number == 0 and not (start.startswith(b"#") or not start.strip() or known):
                raise CloudFormatError(lines.file, "byte 0", "this is no PCD header", "check the file's type")
            if len(prefix) > HEADER_LIMIT:
                lines.raise_format_error(f"no 'DATA' line within {HEADER_LIMIT} bytes", "check the file's type")
            return None
        lines.number += 1
        line = prefix[position : end + 1]
        position = end + 1
        rewritten.append(line)
        if line.startswith(b"#") or not (words := line.decode("ascii", "replace").split()):
            continue
        if words[0] not in KEYWORDS:
            lines.raise_format_error(f"{shorten(words[0])} is no PCD keyword", "check the file's type")
        keyword = "FIELDS" if words[0] == "COLUMNS" else words[0]
        if keyword in entries:
            lines.raise_format_error(f"{keyword} stands twice")
        entries[keyword] = words[1:]
        if keyword == "VIEWPOINT":
            rewritten[-1] = ORIGIN + line[len(line.rstrip()) :]
    dtype = _record(entries, lines)
    return CloudHeader(
        "pcd", _encoding(entries, lines), Layout.of(dtype), _points(entries, lines), position, b"".join(rewritten)
    )


def _record(entries: dict[str, list[str]], lines: HeaderLines) -> np.dtype[Any]:
    """The record type; padding fields, all named `_`, get unique names."""
    names = entries.get("FIELDS", [])
    counts = entries.get("COUNT", ["1"] * len(names))
    for keyword in ("SIZE", "TYPE"):
        if keyword not in entries:
            lines.raise_format_error(f"there is no {keyword} line")
    if not names or not len(names) == len(entries["SIZE"]) == len(entries["TYPE"]) == len(counts):
        lines.raise_format_error("FIELDS, SIZE, TYPE and COUNT have different numbers of entries")
    columns: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
    for index, (name, size, kind, times) in enumerate(
        zip(names, entries["SIZE"], entries["TYPE"], counts, strict=True)
    ):
        bytes_ = lines.whole_number(size, f"SIZE of {name}", 1)
        if (kind, bytes_) not in TYPES:
            lines.raise_format_error(
                f"field {shorten(name)} has the type {shorten(kind)} of {bytes_} bytes, which PCD does not have"
            )
        number = lines.whole_number(times, f"COUNT of {name}", 1)
        if number * bytes_ > RECORD_LIMIT:
            lines.raise_format_error(f"field {shorten(name)} has {number} elements")
        own = f"_{index}" if name == "_" else name
        if own in (column[0] for column in columns):
            lines.raise_format_error(f"field {shorten(name)} stands twice")
        code = f"<{kind.lower()}{bytes_}"
        columns.append((own, code) if number == 1 else (own, code, (number,)))
    dtype = np.dtype(columns)
    for name in ("x", "y", "z"):
        if name not in names:
            lines.raise_format_error(f"there is no field {name!r}")
        if dtype[name].kind != "f":
            lines.refuse(f"field {name!r} is no single float", "write x, y, z as floats")
    return dtype


def _encoding(entries: dict[str, list[str]], lines: HeaderLines) -> Encoding:
    words = entries["DATA"]
    if len(words) != 1 or words[0] not in ENCODINGS:
        lines.raise_format_error(f"DATA is {shorten(' '.join(words))}", f"known: {', '.join(ENCODINGS)}")
    return ENCODINGS[words[0]]


def _points(entries: dict[str, list[str]], lines: HeaderLines) -> int:
    """Number of points by WIDTH × HEIGHT and POINTS, which must agree where both exist."""
    numbers: dict[str, int] = {}
    for keyword in ("WIDTH", "HEIGHT", "POINTS"):
        words = entries.get(keyword)
        if words is not None:
            numbers[keyword] = lines.whole_number(" ".join(words), keyword)
    area = numbers["WIDTH"] * numbers.get("HEIGHT", 1) if "WIDTH" in numbers else None
    points = numbers.get("POINTS", area)
    if points is None:
        lines.raise_format_error("neither POINTS nor WIDTH says how many points there are")
    if area is not None and area != points:
        lines.raise_format_error(f"WIDTH x HEIGHT is {area}, but POINTS is {points}")
    return points


PADDING = re.compile(r"_\d+")


def format_header(layout: Layout, count: int, encoding: str = "binary", rows: int = 1) -> bytes:
    """A PCD v0.7 header for records of `layout`, of the same length for every `count`; organised with several rows."""
    fields = [(name, *_field(layout.dtype[name])) for name in layout.dtype.names or ()]
    lines = [
        "# .PCD v0.7 - Point Cloud Data file format",
        "# lengths in mm".ljust(60 - 2 * len(str(count))),
        "VERSION 0.7",
        "FIELDS " + " ".join("_" if PADDING.fullmatch(name) else name for name, *_ in fields),
        "SIZE " + " ".join(str(size) for _, size, _, _ in fields),
        "TYPE " + " ".join(kind for _, _, kind, _ in fields),
        "COUNT " + " ".join(str(number) for *_, number in fields),
        f"WIDTH {count // rows}",
        f"HEIGHT {rows}",
        ORIGIN.decode(),
        f"POINTS {count}",
        f"DATA {encoding}",
    ]
    return ("\n".join(lines) + "\n").encode("ascii")


def _field(dtype: np.dtype[Any]) -> tuple[int, str, int]:
    base, shape = dtype.subdtype or (dtype, ())
    return base.itemsize, base.kind.upper(), int(np.prod(shape, dtype=int))
