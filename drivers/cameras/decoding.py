"""Decodes PNG and JPEG files and refuses incomplete ones. OpenCV is given only complete files."""

import re
import struct
import zlib
from contextlib import suppress

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.cameras.pixel_depth import to_8_bit
from drivers.errors import GarbledAnswer

PNG_MAGIC = b"\x89PNG\r\n\x1a\n"
JPEG_MAGIC = b"\xff\xd8\xff"
JPEG_END, JPEG_SCAN = 0xD9, 0xDA
JPEG_MARKER = re.compile(rb"\xff[^\x00\xff\xd0-\xd7]")
"""Ends a scan: neither a stuffed 0 nor a restart."""
JPEG_SIZES = frozenset({*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC})
"""Markers whose segment holds a JPEG's height and width (ITU T.81, table B.1)."""
JPEG_LONE = frozenset({0x01, *range(0xD0, 0xDA)})
"""Markers without a segment: before the end of the picture there are none between segments."""
ORIENTATION = 274
TIFFS = {
    **{mark: (order, "I", "H", 4, 12) for mark, order in ((b"II*\0", "<"), (b"MM\0*", ">"))},
    **{mark: (order, "Q", "Q", 8, 20) for mark, order in ((b"II+\0", "<"), (b"MM\0+", ">"))},
}
"""By the beginning of a TIFF and a BigTIFF: order, kinds of offset and count, place of the first, bytes of an entry."""
MAX_SCANS = 100
"""Scans of a JPEG: each is a pass over all pixels; progressive ones have about ten."""
MAX_DECODED_BYTES = 200_000_000
"""Bytes of the decoded picture: 200 megapixels grey, 66 in colour."""
FIX = "check that the device writes whole PNG or JPEG pictures"

# Keeps grey images grey and 16 bits; drops alpha; ignores EXIF rotation, since calibration needs the sensor's rows.
FLAGS = cv2.IMREAD_ANYCOLOR | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION


def decode(device: str, encoded: bytes, image_size: tuple[int, int] | None = None) -> NDArray[np.uint8]:
    """Decode a file to uint8 (h, w) grey or (h, w, 3) BGR. `image_size`: required (width, height), None for any.

    Of a 16-bit file the bits that it uses are scaled to 8.
    Raises GarbledAnswer for an empty, truncated or foreign file, and for another size.
    """
    try:
        width, height = _whole_picture_size(encoded)
    except (ValueError, struct.error, IndexError) as error:
        raise GarbledAnswer(device, f"not a whole picture: {error}", FIX) from error
    require_size(device, "the picture is", (width, height), image_size)
    try:
        image = cv2.imdecode(np.frombuffer(encoded, np.uint8), FLAGS)
    except cv2.error as error:
        raise GarbledAnswer(device, f"the picture cannot be decoded ({error.err})", FIX) from error
    if image is None:
        raise GarbledAnswer(device, "the picture cannot be decoded", FIX)
    return to_8_bit(np.asarray(image))


def require_size(device: str, what: str, size: tuple[int, int], wanted: tuple[int, int] | None) -> None:
    """Raises GarbledAnswer for another (width, height) than the wanted one, None for any."""
    if wanted is not None and size != wanted:
        what = f"{what} {size[0]}×{size[1]}, expected {wanted[0]}×{wanted[1]}"
        raise GarbledAnswer(device, what, "set the camera to the size its intrinsics were found at")


def file_bits(encoded: bytes) -> int:
    """Bits of a grey level in a whole PNG or JPEG: 8 or 16 (PNG specification, 11.2.1 IHDR)."""
    return 16 if encoded.startswith(PNG_MAGIC) and encoded[24] == 16 else 8


def is_truncated(encoded: bytes) -> bool:
    """True for a PNG or JPEG that is truncated, damaged or of too many pixels, False for every other file.

    Checked here because libpng would write to standard error, and OpenCV 4 would fill the missing part with grey.
    """
    try:
        _whole_picture_size(encoded)
    except (ValueError, struct.error, IndexError):
        return encoded.startswith((PNG_MAGIC, JPEG_MAGIC))
    return False


def without_orientation(encoded: bytes) -> bytes:
    """A TIFF whose rows come as they are stored (TIFF 6.0, tag 274), which OpenCV turns or mirrors whatever its flags.

    Any other file, and a damaged TIFF, as it is.
    """
    if (kind := TIFFS.get(encoded[:4])) is None:
        return encoded
    order, offset, number, first, size = kind
    changed = bytearray(encoded)
    with suppress(struct.error, OverflowError):
        (at,) = struct.unpack_from(order + offset, changed, first)
        (count,) = struct.unpack_from(order + number, changed, at)
        begin = at + struct.calcsize(order + number)
        for entry in range(begin, begin + size * count, size):
            if struct.unpack_from(f"{order}H", changed, entry) == (ORIENTATION,):
                struct.pack_into(f"{order}H{offset}HH", changed, entry + 2, 3, 1, 1, 0)
    return bytes(changed)


def _whole_picture_size(encoded: bytes) -> tuple[int, int]:
    """(width, height) of a complete PNG or JPEG; raises ValueError, or IndexError when it is truncated."""
    if not encoded:
        raise ValueError("it is empty")
    for magic, size_of in ((PNG_MAGIC, _png_size), (JPEG_MAGIC, _jpeg_size)):
        if encoded.startswith(magic):
            width, height, pixel_bytes = size_of(encoded)
            if not 0 < width * height * pixel_bytes <= MAX_DECODED_BYTES:
                raise ValueError(f"it claims {width}×{height} pixels of {pixel_bytes} bytes")
            return width, height
    if PNG_MAGIC.startswith(encoded[:8]) or JPEG_MAGIC.startswith(encoded[:3]):
        raise ValueError("it ends early")
    raise ValueError(f"neither PNG nor JPEG, it begins with {encoded[:8]!r}")


def _png_size(encoded: bytes) -> tuple[int, int, int]:
    """(width, height, bytes a pixel) of a PNG with valid chunk checksums (PNG specification, 5.3) up to IEND.

    IHDR must be the first chunk and the only one: readers differ in which of two they believe.
    """
    at = len(PNG_MAGIC)
    size = (0, 0, 0)
    while True:
        if len(encoded) < at + 12:
            raise ValueError("the PNG ends early")
        length, kind = struct.unpack_from(">I4s", encoded, at)
        end = at + 12 + length
        if len(encoded) < end:
            raise ValueError("the PNG ends early")
        if zlib.crc32(memoryview(encoded)[at + 4 : end - 4]) != int.from_bytes(encoded[end - 4 : end]):
            raise ValueError(f"the PNG's checksum does not hold in its {kind!r} part")
        if (kind == b"IHDR") != (at == len(PNG_MAGIC)) or (kind == b"IHDR" and length != 13):
            raise ValueError("the PNG's size does not stand in one IHDR part at its start")
        if kind == b"acTL":
            raise ValueError("the PNG is animated")
        if kind == b"IHDR":
            width, height, bits, colour_type = struct.unpack_from(">IIBB", encoded, at + 8)
            size = (width, height, (3 if colour_type & 2 else 1) * (2 if bits == 16 else 1))
        if kind == b"IEND":
            return size
        at = end


def _jpeg_size(encoded: bytes) -> tuple[int, int, int]:
    """(width, height, bytes a pixel) of a JPEG up to its end marker; a film may follow. It has no checksums."""
    at, size, scans = 2, None, 0
    while encoded[at : at + 1] == b"\xff":
        marker = encoded[at + 1]
        if marker == 0xFF:
            at += 1
            continue
        if marker == JPEG_END and size:
            return size
        length = int.from_bytes(encoded[at + 2 : at + 4])
        if marker in JPEG_LONE or length < 2 or (marker in JPEG_SIZES and size):
            break
        if marker in JPEG_SIZES:
            height, width, channels = struct.unpack_from(">HHB", encoded, at + 5)
            size = width, height, min(channels, 3)
        at += 2 + length
        if marker == JPEG_SCAN:
            scans, behind = scans + 1, JPEG_MARKER.search(encoded, at)
            at = behind.start() if behind else len(encoded)
        if scans > MAX_SCANS:
            raise ValueError(f"the JPEG has more than {MAX_SCANS} scans")
    raise ValueError("the JPEG's segments are torn" if at < len(encoded) else "the JPEG ends early")
