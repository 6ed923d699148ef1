"""Reads clouds of any format from files, in blocks of bounded size: `open_cloud(path)`."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from registration.errors import CloudTruncated, CloudUnsupported
from registration.io.durable_file import GuardedFile
from registration.io.formats import npy, pcd, ply, rows
from registration.io.formats.bodies import BLOCK_BYTES, decoder_of, require_end
from registration.io.formats.compressed import lzf_source
from registration.io.formats.detect import HeaderParser, octets
from registration.io.formats.extras import e57_source, las_source
from registration.io.formats.header import HEADER_LIMIT, CloudHeader, CloudSource
from registration.io.formats.npz import npz_source
from registration.io.formats.sections import SectionPassage
from registration.io.formats.stl import stl_source
from registration.points.layout import Records

PARSERS: dict[str, HeaderParser] = {
    ".ply": ply.parse_header,
    ".pcd": pcd.parse_header,
    ".xyz": rows.parse_header,
    ".txt": rows.parse_header,
    ".csv": rows.parse_header,
    ".npy": npy.parse_header,
    ".bin": octets,
    ".f32": octets,
}
"""Formats whose header is parsed from the first bytes, by suffix."""


def _record_source(file: GuardedFile, header: CloudHeader, name: str) -> CloudSource:
    """Of a format that consists of a header and records in sequence."""

    def blocks() -> Iterator[Records]:
        """The points; elements beside them are checked and skipped. Raises CloudError's leaves."""
        lead, tail = (SectionPassage(elements, header.encoding, name) for elements in (header.lead, header.tail))
        decoder = decoder_of(header, name)
        file.seek(header.length)
        for piece in _pieces(file, header):
            rest = piece
            if not lead.complete:
                rest = rest[lead.take(rest) :]
            if lead.complete and not decoder.complete and rest:
                yield from (block if block.flags.writeable else block.copy() for block in decoder.take(rest))
                rest = rest[decoder.taken :]
            if decoder.complete and not tail.complete and rest:
                rest = rest[tail.take(rest) :]
            require_end(header, name, decoder.points, rest)
        lead.finish()
        yield from decoder.finish()
        tail.finish()

    return CloudSource(header.layout, header.count, blocks)


def _pieces(file: GuardedFile, header: CloudHeader) -> Iterator[memoryview]:
    """The file from the current position, through one buffer of whole records."""
    size = max(1, BLOCK_BYTES // header.layout.itemsize) * header.layout.itemsize
    buffer = memoryview(bytearray(size))
    while length := file.readinto(buffer):
        yield buffer[:length]


def read_header(file: GuardedFile, parser: HeaderParser, name: str) -> CloudHeader:
    """The header at the start of the file, checked against the file's size. Raises CloudError's leaves."""
    prefix = file.read(4096)
    header = parser(prefix, name)
    while header is None:
        more = file.read(HEADER_LIMIT)
        if not more:
            header = parser(prefix + b"\n", name) if parser is rows.parse_header and prefix else None
            if header is None:
                what = f"the file ends after {len(prefix)} bytes, inside the header"
                raise CloudTruncated(name, "header", what, "copy the whole file again")
            break
        prefix += more
        header = parser(prefix, name)
    size = file.seek(0, 2)
    if header.body_length is not None and size - header.length < header.body_length:
        promised = f"{header.count} points in {header.body_length} bytes"
        what = f"the header promises {promised}, but {size - header.length} bytes follow"
        raise CloudTruncated(name, f"byte {size}", what, "copy the whole file again")
    return header


@contextmanager
def open_cloud(path: Path, name: str | None = None) -> Iterator[CloudSource]:
    """Open a cloud file by its suffix. Raises CloudError's leaves, naming `name` (by default the path's name)."""
    name = name or path.name
    with GuardedFile.reading(path, name) as file:
        yield _source(path, file, name)


def _source(path: Path, file: GuardedFile, name: str) -> CloudSource:
    suffix = path.suffix.lower()
    if suffix in SPECIAL:
        return SPECIAL[suffix](file, name)
    if suffix not in PARSERS:
        known = ", ".join(sorted([*PARSERS, *SPECIAL]))
        raise CloudUnsupported(name, "suffix", f"clouds of type {suffix!r} cannot be read", f"use one of {known}")
    header = read_header(file, PARSERS[suffix], name)
    if header.encoding == "compressed":
        return lzf_source(file, header, name)
    return _record_source(file, header, name)


SPECIAL: dict[str, Callable[[GuardedFile, str], CloudSource]] = {
    ".stl": stl_source,
    ".las": lambda file, name: las_source(file, name, compressed=False),
    ".laz": lambda file, name: las_source(file, name, compressed=True),
    ".e57": e57_source,
    ".npz": npz_source,
}
"""Formats that are not a header with records."""
