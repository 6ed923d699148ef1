"""Decodes PNG and JPEG files and refuses incomplete ones. OpenCV is given only complete files."""

import struct
import zlib

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.errors import GarbledAnswer

PNG_MAGIC = b"\x89PNG\r\n\x1a\n"
JPEG_MAGIC = b"\xff\xd8\xff"
JPEG_END = b"\xff\xd9"
JPEG_SIZES = frozenset({*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC})
"""Markers whose segment holds a JPEG's height and width (ITU T.81, table B.1)."""
MAX_PIXELS = 200_000_000
FIX = "check that the device writes whole PNG or JPEG pictures"

# Keeps grey images grey, drops alpha and 16 bit; EXIF rotation is ignored, since calibration needs the sensor's rows.
FLAGS = cv2.IMREAD_ANYCOLOR | cv2.IMREAD_IGNORE_ORIENTATION


def decode(device: str, encoded: bytes, image_size: tuple[int, int] | None = None) -> NDArray[np.uint8]:
    """Decode a file to uint8 (h, w) grey or (h, w, 3) BGR. `image_size`: required (width, height), None for any.

    Raises GarbledAnswer for an empty, truncated or foreign file, and for another size.
    """
    try:
        width, height = _whole_picture_size(encoded)
    except (ValueError, struct.error, IndexError) as error:
        raise GarbledAnswer(device, f"not a whole picture: {error}", FIX) from error
    if image_size is not None and (width, height) != image_size:
        what = f"the picture is {width}×{height}, expected {image_size[0]}×{image_size[1]}"
        raise GarbledAnswer(device, what, "set the camera to the size its intrinsics were found at")
    if not 0 < width * height <= MAX_PIXELS:
        raise GarbledAnswer(device, f"the picture claims {width}×{height} pixels", FIX)
    try:
        image = cv2.imdecode(np.frombuffer(encoded, np.uint8), FLAGS)
    except cv2.error as error:
        raise GarbledAnswer(device, f"the picture cannot be decoded ({error.err})", FIX) from error
    if image is None:
        raise GarbledAnswer(device, "the picture cannot be decoded", FIX)
    return image.astype(np.uint8, copy=False)


def is_truncated(encoded: bytes) -> bool:
    """True for a PNG or JPEG that is truncated or damaged, False for every other file.

    Checked here because libpng would write to standard error, and OpenCV 4 would fill the missing part with grey.
    """
    try:
        _whole_picture_size(encoded)
    except (ValueError, struct.error, IndexError):
        return encoded.startswith((PNG_MAGIC, JPEG_MAGIC))
    return False


def _whole_picture_size(encoded: bytes) -> tuple[int, int]:
    """(width, height) of a complete PNG or JPEG; raises ValueError, or IndexError when it is truncated."""
    if not encoded:
        raise ValueError("it is empty")
    if encoded.startswith(PNG_MAGIC):
        return _png_size(encoded)
    if encoded.startswith(JPEG_MAGIC):
        return _jpeg_size(encoded)
    if PNG_MAGIC.startswith(encoded[:8]) or JPEG_MAGIC.startswith(encoded[:3]):
        raise ValueError("it ends early")
    raise ValueError(f"neither PNG nor JPEG, it begins with {encoded[:8]!r}")


def _png_size(encoded: bytes) -> tuple[int, int]:
    """Size of a PNG with valid chunk checksums (PNG specification, 5.3) up to IEND."""
    at = len(PNG_MAGIC)
    size = (0, 0)
    while True:
        if len(encoded) < at + 12:
            raise ValueError("the PNG ends early")
        length, kind = struct.unpack_from(">I4s", encoded, at)
        end = at + 12 + length
        if len(encoded) < end:
            raise ValueError("the PNG ends early")
        if zlib.crc32(memoryview(encoded)[at + 4 : end - 4]) != int.from_bytes(encoded[end - 4 : end]):
            raise ValueError(f"the PNG's checksum does not hold in its {kind!r} part")
        if kind == b"IHDR":
            size = struct.unpack_from(">II", encoded, at + 8)
        if kind == b"IEND":
            return size[0], size[1]
        at = end


def _jpeg_size(encoded: bytes) -> tuple[int, int]:
    """Size of a JPEG with an end marker; JPEG has no checksums."""
    if JPEG_END not in encoded[-64:]:
        raise ValueError("the JPEG ends early")
    at = 2
    while encoded[at] == 0xFF:
        marker = encoded[at + 1]
        if marker == 0xFF:
            at += 1
            continue
        length = int.from_bytes(encoded[at + 2 : at + 4])
        if marker in JPEG_SIZES:
            height, width = struct.unpack_from(">HH", encoded, at + 5)
            return width, height
        at += 2 + length
    raise ValueError("the JPEG's segments are torn")
