"""E57 files with an XML section of one's own."""

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

PAGE, DATA = 1024, 1020


def e57(folder: Path, points: int = 10) -> bytes:
    """A file of one scan; skips the test when pye57 is not installed."""
    pye57 = pytest.importorskip("pye57", reason="pye57 is not installed: E57 is not tested")
    file = pye57.E57(str(folder / "sound.e57"), mode="w")
    file.write_scan_raw({f"cartesian{axis}": np.arange(float(points)) for axis in "XYZ"})
    file.close()
    return (folder / "sound.e57").read_bytes()


def with_xml(file: bytes, edit: Callable[[bytes], bytes]) -> bytes:
    """The file with its XML section edited; lengths and checksums hold."""
    offset, length = struct.unpack_from("<QQ", file, 24)
    start = offset // PAGE * DATA + offset % PAGE
    content = b"".join(file[page : page + DATA] for page in range(0, len(file), PAGE))
    xml = edit(content[start : start + length])
    data = bytearray(content[:start] + xml)
    data += bytes(-len(data) % DATA)
    struct.pack_into("<Q", data, 16, len(data) // DATA * PAGE)
    struct.pack_into("<Q", data, 32, len(xml))
    pages = (bytes(data[at : at + DATA]) for at in range(0, len(data), DATA))
    return b"".join(page + struct.pack(">I", crc32c(page)) for page in pages)


def crc32c(data: bytes) -> int:
    """CRC-32C (Castagnoli), bit by bit."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ (0x82F63B78 if crc & 1 else 0)
    return crc ^ 0xFFFFFFFF
