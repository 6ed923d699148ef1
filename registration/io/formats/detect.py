"""Finds a cloud's header parser by its media type."""

from collections.abc import Callable

from registration.errors import CloudFormatError, CloudUnsupported
from registration.io.formats import pcd, ply
from registration.io.formats.header import CloudHeader
from registration.points.layout import XYZ_FLOAT32

HeaderParser = Callable[[bytes, str], CloudHeader | None]


MAGIC = {
    b"ASTM-E57": "E57",
    b"LASF": "LAS or LAZ",
    b"ply\n": "PLY",
    b"ply\r": "PLY",
    b"# .PCD": "PCD",
    b"\x93NUMPY": "NPY",
    b"PK\x03\x04": "ZIP or NPZ",
    b"solid ": "STL",
}
"""How files of other formats begin."""


def octets(prefix: bytes, file: str) -> CloudHeader | None:
    """Raw float32 x, y, z, little endian, no header, up to the end of the bytes; None for 1 to 7 bytes.

    Raises CloudFormatError for a file of another format.
    """
    if 0 < len(prefix) < max(map(len, MAGIC)):
        return None
    for magic, name in MAGIC.items():
        if prefix.startswith(magic):
            what = f"this begins as {name} does, not as float32 x, y, z"
            raise CloudFormatError(file, "byte 0", what, "state its own type, or convert it to PLY")
    return CloudHeader("octets", "binary", XYZ_FLOAT32, None, 0, b"")


MEDIA_TYPES: dict[str, HeaderParser] = {
    "application/x-ply": ply.parse_header,
    "application/ply": ply.parse_header,
    "model/ply": ply.parse_header,
    "application/x-pcd": pcd.parse_header,
    "application/pcd": pcd.parse_header,
    "application/octet-stream": octets,
}


def parser_of(media_type: str, file: str) -> HeaderParser:
    """Header parser of a media type (parameters after ';' are ignored). Raises CloudUnsupported."""
    name = media_type.split(";")[0].strip().lower()
    if name not in MEDIA_TYPES:
        raise CloudUnsupported(
            file, "media type", f"clouds of type {name!r} are not streamed", f"send one of {', '.join(MEDIA_TYPES)}"
        )
    return MEDIA_TYPES[name]
