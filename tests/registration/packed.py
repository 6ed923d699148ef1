"""PCD `binary_compressed`, packed by a small compressor of the tests' own."""

import numpy as np

from registration.io.formats import pcd
from registration.points.layout import Layout, Records


def lzf(data: bytes) -> bytes:
    """A small compressor: runs of what stood `distance` before, literals otherwise."""
    out, literals, position = bytearray(), bytearray(), 0
    seen: dict[bytes, int] = {}
    while position < len(data):
        key = data[position : position + 3]
        match = seen.get(key, -1) if len(key) == 3 else -1
        seen[key] = position
        if match >= 0 and position - match <= 8192:
            length = 3
            while length < 264 and position + length < len(data) and data[match + length] == data[position + length]:
                length += 1
            for start in range(0, len(literals), 32):
                out += bytes([len(literals[start : start + 32]) - 1]) + literals[start : start + 32]
            literals.clear()
            back = position - match - 1
            out += bytes([min(7, length - 2) << 5 | back >> 8])
            out += bytes([length - 9]) if length >= 9 else b""
            out += bytes([back & 255])
            position += length
        else:
            literals.append(data[position])
            position += 1
    for start in range(0, len(literals), 32):
        out += bytes([len(literals[start : start + 32]) - 1]) + literals[start : start + 32]
    return bytes(out)


def compressed(layout: Layout, records: Records) -> bytes:
    columns = b"".join(np.ascontiguousarray(records[name]).tobytes() for name in layout.dtype.names or ())
    packed = lzf(columns)
    sizes = np.array([len(packed), len(columns)], "<u4").tobytes()
    return pcd.format_header(layout, len(records), "binary_compressed") + sizes + packed


def literals(data: bytes) -> bytes:
    """As LZF without a single back reference."""
    pieces = (data[start : start + 32] for start in range(0, len(data), 32))
    return b"".join(bytes([len(piece) - 1]) + piece for piece in pieces)
