"""Reads PCD `binary_compressed`: LZF over whole columns, unpacked to a temporary file to bound memory."""

import tempfile
from collections.abc import Callable, Iterator
from typing import BinaryIO

import numpy as np

from registration.errors import CloudFormatError, CloudTruncated
from registration.io.durable_file import GuardedFile
from registration.io.formats.bodies import require_end
from registration.io.formats.header import CloudHeader, CloudSource
from registration.points.layout import Records

BLOCK_POINTS = 1 << 14


def lzf_source(file: GuardedFile, header: CloudHeader, name: str) -> CloudSource:
    """The points behind the header; `blocks` raises CloudFormatError, CloudTruncated, CloudTooLong."""

    def blocks() -> Iterator[Records]:
        count, dtype = header.count or 0, header.layout.dtype
        with tempfile.TemporaryFile() as columns:
            _expand_to(columns, file, header, name)
            for start in range(0, count, BLOCK_POINTS):
                points = min(BLOCK_POINTS, count - start)
                block = np.empty(points, dtype)
                column = 0
                for field in dtype.names or ():
                    kind = dtype[field]
                    columns.seek(column + start * kind.itemsize)
                    raw = columns.read(points * kind.itemsize)
                    base, shape = kind.subdtype or (kind, ())
                    block[field] = np.frombuffer(raw, base).reshape(points, *shape)
                    column += count * kind.itemsize
                yield block

    return CloudSource(header.layout, header.count, blocks)


def _expand_to(columns: BinaryIO, file: GuardedFile, header: CloudHeader, name: str) -> None:
    expected = (header.count or 0) * header.layout.itemsize
    file.seek(header.length)
    sizes = file.read(8)
    if len(sizes) < 8:
        raise CloudTruncated(name, "compressed sizes", "the file ends here", "copy the whole file again")
    packed, unpacked = (int(size) for size in np.frombuffer(sizes, "<u4"))
    if unpacked != expected:
        what = f"the header promises {expected} bytes of points, the compressed part {unpacked}"
        raise CloudFormatError(name, "compressed sizes", what, "write the file again")
    written = 0
    try:
        for piece in decompress(file.read, packed):
            written += len(piece)
            if written > expected:
                break
            columns.write(piece)
    except LzfDamaged as error:
        raise CloudTruncated(
            name,
            f"compressed byte {error.position}",
            "the compressed points are cut or damaged",
            "copy the file again",
        ) from None
    if written != expected:
        what = f"the compressed part holds {written} bytes where {expected} belong"
        raise CloudFormatError(name, "compressed points", what, "write the file again")
    while rest := file.read(1 << 16):
        require_end(header, name, header.count or 0, rest)


# LZF (Lehmann), in bounded memory.

WINDOW = 1 << 13
"""Longest distance of a back reference."""

FLUSH = 1 << 18


class LzfDamaged(Exception):
    """`position` in the compressed bytes of a truncated token or of a reference before the start."""

    def __init__(self, position: int) -> None:
        self.position = position
        super().__init__(f"damaged at byte {position}")


def decompress(read: Callable[[int], bytes], length: int) -> Iterator[bytes]:
    """Decompress `length` bytes, in pieces. `read(n)` returns at most n bytes. Raises LzfDamaged."""
    pending, window, done = b"", b"", 0
    while done < length:
        more = read(min(FLUSH, length - done - len(pending)))
        pending += more
        complete = done + len(pending) == length
        if not more and not complete:
            raise LzfDamaged(done + len(pending))
        used, out = _expand(pending, window, complete, done)
        yield out[len(window) :]
        window, pending, done = out[-WINDOW:], pending[used:], done + used


def _expand(data: bytes, window: bytes, last: bool, base: int) -> tuple[int, bytes]:
    """Expand complete tokens of `data`: (bytes used, `window` with the output appended)."""
    out = bytearray(window)
    position, end = 0, len(data)
    safe = end if last else end - 34
    while position < safe:
        control = data[position]
        if control < 32:
            stop = position + control + 2
            if stop > end:
                raise LzfDamaged(base + position)
            out += data[position + 1 : stop]
            position = stop
            continue
        size, start = control >> 5, position
        position += 1
        if size == 7:
            if position >= end:
                raise LzfDamaged(base + start)
            size += data[position]
            position += 1
        if position >= end:
            raise LzfDamaged(base + start)
        back = ((control & 31) << 8) + data[position] + 1
        position += 1
        size += 2
        source = len(out) - back
        if source < 0:
            raise LzfDamaged(base + start)
        if back >= size:
            out += out[source : source + size]
        else:
            out += (out[source:] * (size // back + 1))[:size]
    return position, bytes(out)
