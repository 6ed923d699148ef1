"""Checks a LAZ file's chunk sizes before lazrs allocates memory for them.

lazrs allocates whatever a chunk table or a chunk's header promises; too much ends the process. So every size is
compared with the bytes present. (LASzip: Isenburg 2013; chunk heads of record formats 6 and up as in laszip's
`lasreadpoint.cpp`.)
"""

import struct
from itertools import accumulate
from typing import Any

from registration.errors import CloudFormatError, CloudTruncated
from registration.io.durable_file import GuardedFile
from registration.io.formats.las import FIX, MIN_HEADER_BYTES, RECORD_HEAD, LasHeader

LASZIP = b"laszip encoded"
ITEMS_BEGIN, ITEM_BYTES = 32, 6
LAYERS = {10: 9, 11: 1, 12: 2, 13: 1}
"""Layers of a chunk by item type of record formats 6 and up; extra bytes (type 14) have one layer per byte."""
EXTRA_BYTES = 14
CHUNK_LIMIT = 1 << 28
"""Largest unpacked chunk in bytes, which lazrs allocates; writers usually put 50,000 points (2 MB) into one."""


def require_sound_chunks(file: GuardedFile, header: LasHeader, lazrs: Any) -> None:
    """Check that every chunk lies within the file and every layer within its chunk.

    Raises CloudFormatError, CloudTruncated; passes on what lazrs raises on a damaged table.
    """
    if not header.count:
        return
    record = _laszip_record(file, header)
    vlr = lazrs.LazVlr(record)
    if vlr.item_size() != header.record_bytes:
        what = f"its records have {vlr.item_size()} bytes in one place, {header.record_bytes} in another"
        raise CloudFormatError(file.name, "header", what, FIX)
    room = _require_table(file, header)
    file.seek(header.begin)
    table = lazrs.read_chunk_table(file.raw, vlr)
    points = max((int(points) for points, _ in table), default=0)
    if points * header.record_bytes > CHUNK_LIMIT:
        raise CloudFormatError(file.name, "chunk table", f"it promises a chunk of {points} points", FIX)
    chunks = [int(size) for _, size in table]
    if sum(chunks) > room:
        raise CloudFormatError(
            file.name, "chunk table", f"it promises {sum(chunks)} bytes of chunks, but there are {room}", FIX
        )
    items = [struct.unpack_from("<HH", record, at) for at in range(ITEMS_BEGIN + 2, len(record) - 3, ITEM_BYTES)]
    # Of a chunk; none in the older record formats.
    if layers := sum(size if kind == EXTRA_BYTES else LAYERS.get(kind, 0) for kind, size in items):
        begins = accumulate(chunks, initial=header.begin + 8)
        for index, (begin, size) in enumerate(zip(begins, chunks, strict=False)):
            file.seek(begin + header.record_bytes + 4)
            sizes = file.read(4 * layers)
            promised = sum(struct.unpack(f"<{len(sizes) // 4}I", sizes[: len(sizes) // 4 * 4]))
            if promised > size:
                what = f"its layers promise {promised} bytes of {size}"
                raise CloudFormatError(file.name, f"chunk {index}", what, FIX)


def _laszip_record(file: GuardedFile, header: LasHeader) -> bytes:
    """The variable length record that describes the compression."""
    file.seek(94)
    at = int.from_bytes(file.read(2), "little")
    while MIN_HEADER_BYTES <= at <= header.begin - RECORD_HEAD:
        file.seek(at)
        if len(head := file.read(RECORD_HEAD)) < RECORD_HEAD:
            break
        length = int.from_bytes(head[20:22], "little")
        if head[2:18].startswith(LASZIP):
            return file.read(length)
        at += RECORD_HEAD + length
    raise CloudFormatError(file.name, "header", "no record says how its points are packed", FIX)


def _require_table(file: GuardedFile, header: LasHeader) -> int:
    """Number of bytes from the points to the chunk table, after checking that its chunks fit there."""
    size = file.seek(0, 2)
    for at in (header.begin, size - 8):  # a writer that cannot seek puts the offset at the end
        file.seek(max(0, at))
        place = int.from_bytes(file.read(8), "little", signed=True)
        if place != -1:
            break
    room = place - header.begin - 8
    file.seek(max(0, min(place, size)))
    table = file.read(8)
    if room < 0 or len(table) < 8:
        raise CloudTruncated(file.name, "chunk table", f"it is not at byte {place} of {size}", FIX)
    chunks = int.from_bytes(table[4:], "little")
    if chunks * header.record_bytes > room:  # a chunk begins with one uncompressed record
        raise CloudFormatError(file.name, "chunk table", f"it promises {chunks} chunks in {room} bytes", FIX)
    return room
