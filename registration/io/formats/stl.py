"""STL: the triangles' corners as points, three per triangle; shared corners repeat."""

import re
from collections.abc import Iterator

import numpy as np

from registration.errors import CloudFormatError, CloudTruncated
from registration.io.durable_file import GuardedFile
from registration.io.formats.header import CloudSource, shorten
from registration.points.layout import XYZ_FLOAT32, Records

FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", 9), ("attribute", "<u2")])
BLOCK_FACETS = 1 << 12
LINE_LIMIT = 1 << 12
VERTEX = re.compile(rb"\s*vertex\s", re.IGNORECASE)


def _binary_blocks(file: GuardedFile) -> Iterator[Records]:
    """Of 80 bytes, the number of facets, the facets."""
    file.seek(84)
    while raw := file.read(BLOCK_FACETS * FACET.itemsize):
        corners = np.ascontiguousarray(np.frombuffer(raw, FACET)["corners"])
        yield corners.reshape(-1, 3).view(XYZ_FLOAT32.dtype)[:, 0]


def _text_blocks(file: GuardedFile, name: str) -> Iterator[Records]:
    """Of lines 'vertex x y z' among others."""
    file.seek(0)
    number, ended = 0, False
    corners: list[tuple[float, ...]] = []
    rest = b""
    while raw := file.read(1 << 16):
        *lines, rest = (rest + raw).split(b"\n")
        if len(rest) > LINE_LIMIT:
            raise _line_error(name, number + len(lines), rest[:60])
        for line in lines:
            number += 1
            if VERTEX.match(line):
                try:
                    x, y, z = (float(word) for word in line.split()[1:])
                except ValueError:
                    raise _line_error(name, number, line) from None
                corners.append((x, y, z))
        yield _block(corners)
        ended = any(line.strip().lower().startswith(b"endsolid") for line in lines) or ended
        corners = []
    if not ended and not rest.strip().lower().startswith(b"endsolid"):
        raise CloudTruncated(name, f"line {number}", "there is no 'endsolid'", "copy the whole file again")


def _line_error(name: str, number: int, line: bytes) -> CloudFormatError:
    what = f"{shorten(line.decode('ascii', 'replace').strip())} is not 'vertex x y z'"
    return CloudFormatError(name, f"line {number}", what, "write the file again")


def _block(corners: list[tuple[float, ...]]) -> Records:
    with np.errstate(over="ignore"):
        return np.array(corners, np.float32).reshape(-1, 3).view(XYZ_FLOAT32.dtype)[:, 0]


def stl_source(file: GuardedFile, name: str) -> CloudSource:
    """Binary when the size fits the number of facets, otherwise text. Raises CloudFormatError, CloudTruncated."""
    head = file.read(84)
    size = file.seek(0, 2)
    facets = int.from_bytes(head[80:84], "little")
    if len(head) == 84 and size == 84 + facets * FACET.itemsize:
        return CloudSource(XYZ_FLOAT32, 3 * facets, lambda: _binary_blocks(file))
    if head.lstrip()[:5].lower() == b"solid" and b"\0" not in head:
        return CloudSource(XYZ_FLOAT32, None, lambda: _text_blocks(file, name))
    if len(head) < 84:
        raise CloudTruncated(name, "header", f"the file ends after {len(head)} bytes", "copy the whole file again")
    what = f"the header promises {facets} facets, {84 + facets * FACET.itemsize} bytes, but the file has {size}"
    raise CloudTruncated(name, "facets", what, "copy the whole file again")
