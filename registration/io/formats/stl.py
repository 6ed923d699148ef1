"""STL: the triangles' corners as points, three per triangle; shared corners repeat."""

import re
from collections.abc import Iterator

import numpy as np

from registration.errors import CloudFormatError, CloudTruncated
from registration.io.durable_file import GuardedFile
from registration.io.formats.header import shorten
from registration.points.layout import XYZ_FLOAT32, Layout, Records

FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", 9), ("attribute", "<u2")])
BLOCK_FACETS = 1 << 12
LINE_LIMIT = 1 << 12
VERTEX = re.compile(rb"\s*vertex\s", re.IGNORECASE)


class BinaryStl:
    """80 bytes, the number of facets, the facets."""

    layout: Layout = XYZ_FLOAT32

    def __init__(self, file: GuardedFile, facets: int) -> None:
        self._file = file
        self.count: int | None = 3 * facets

    def blocks(self) -> Iterator[Records]:
        self._file.seek(84)
        while raw := self._file.read(BLOCK_FACETS * FACET.itemsize):
            corners = np.ascontiguousarray(np.frombuffer(raw, FACET)["corners"])
            yield corners.reshape(-1, 3).view(XYZ_FLOAT32.dtype)[:, 0]


class TextStl:
    """Lines 'vertex x y z' among others."""

    layout: Layout = XYZ_FLOAT32
    count: int | None = None

    def __init__(self, file: GuardedFile, name: str) -> None:
        self._file = file
        self._name = name

    def blocks(self) -> Iterator[Records]:
        self._file.seek(0)
        number, ended = 0, False
        corners: list[tuple[float, ...]] = []
        rest = b""
        while raw := self._file.read(1 << 16):
            *lines, rest = (rest + raw).split(b"\n")
            if len(rest) > LINE_LIMIT:
                self._raise_format_error(number + len(lines), rest[:60])
            for line in lines:
                number += 1
                if VERTEX.match(line):
                    corners.append(self._corner(line, number))
            yield _block(corners)
            ended = any(line.strip().lower().startswith(b"endsolid") for line in lines) or ended
            corners = []
        if not ended and not rest.strip().lower().startswith(b"endsolid"):
            raise CloudTruncated(self._name, f"line {number}", "there is no 'endsolid'", "copy the whole file again")

    def _corner(self, line: bytes, number: int) -> tuple[float, ...]:
        try:
            x, y, z = (float(word) for word in line.split()[1:])
        except ValueError:
            self._raise_format_error(number, line)
        return x, y, z

    def _raise_format_error(self, number: int, line: bytes) -> None:
        what = f"{shorten(line.decode('ascii', 'replace').strip())} is not 'vertex x y z'"
        raise CloudFormatError(self._name, f"line {number}", what, "write the file again")


def _block(corners: list[tuple[float, ...]]) -> Records:
    with np.errstate(over="ignore"):
        return np.array(corners, np.float32).reshape(-1, 3).view(XYZ_FLOAT32.dtype)[:, 0]


def open_stl(file: GuardedFile, name: str) -> BinaryStl | TextStl:
    """Binary when the size fits the number of facets, otherwise text. Raises CloudFormatError, CloudTruncated."""
    head = file.read(84)
    size = file.seek(0, 2)
    facets = int.from_bytes(head[80:84], "little")
    if len(head) == 84 and size == 84 + facets * FACET.itemsize:
        return BinaryStl(file, facets)
    if head.lstrip()[:5].lower() == b"solid" and b"\0" not in head:
        return TextStl(file, name)
    if len(head) < 84:
        raise CloudTruncated(name, "header", f"the file ends after {len(head)} bytes", "copy the whole file again")
    what = f"the header promises {facets} facets, {84 + facets * FACET.itemsize} bytes, but the file has {size}"
    raise CloudTruncated(name, "facets", what, "copy the whole file again")
