"""Pixel formats of industrial cameras by their 32-bit codes, and raw bytes to images with every bit kept.

Names and codes: GenICam Pixel Format Naming Convention (PFNC) 2.4. "Packed" formats are GigE Vision's, of three bytes
for two pixels; formats ending in "p" are PFNC's, least significant bit first without gaps.
"""

import json
from dataclasses import dataclass
from math import lcm
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.errors import GarbledAnswer, IncompletePicture

Packing = Literal["bytes", "gige", "lsb"]
Image = NDArray[Any]

MAX_PIXELS = 200_000_000
FIX = "set another pixel format: Mono8 to Mono16, Bayer or RGB of 8 to 16 bits"


@dataclass(frozen=True)
class PixelFormat:
    """`bits` of a grey level, `channels` stored, their packing; `convert`: the cv2 code that makes them BGR, if any."""

    name: str
    code: int
    bits: int
    channels: int = 1
    packing: Packing = "bytes"
    convert: int | None = None

    @property
    def white(self) -> int:
        """The largest grey level."""
        return (1 << self.bits) - 1

    @property
    def bits_per_pixel(self) -> int:
        """Bits that a pixel takes in the buffer, as the code states (PFNC 2.4, section 5)."""
        return self.code >> 16 & 0xFF


_ROWS: dict[str, dict[str, Any]] = json.loads(Path(__file__).with_suffix(".json").read_text("utf-8"))


def _format(name: str, code: str, convert: str | None = None, **rest: Any) -> PixelFormat:
    return PixelFormat(name, int(code, 16), convert=None if convert is None else getattr(cv2, convert), **rest)


FORMATS: dict[int, PixelFormat] = {known.code: known for known in (_format(name, **row) for name, row in _ROWS.items())}
"""By code."""


def find_format(device: str, code: int) -> PixelFormat:
    """The format of a code. Raises GarbledAnswer for one that is not in FORMATS."""
    known = FORMATS.get(code & 0xFFFFFFFF)
    if known is None:
        raise GarbledAnswer(device, f"pixels of the unknown format 0x{code & 0xFFFFFFFF:08x}", FIX)
    return known


def read_pixels(
    device: str, pixels: PixelFormat, data: NDArray[np.uint8], width: int, height: int, padding: int = 0
) -> Image:
    """Grey (h, w) or BGR (h, w, 3): uint8 of 8-bit formats, else uint16 with the camera's grey levels, not scaled.

    `data`: the buffer as bytes; `padding`: bytes after each row. Raises IncompletePicture, GarbledAnswer.
    """
    if not 0 < width * height <= MAX_PIXELS:
        raise GarbledAnswer(device, f"a picture of {width}×{height} pixels", "check the camera's region of interest")
    row_bits = width * pixels.bits_per_pixel
    if row_bits % 8 == 0 or padding:
        row_bytes = -(-row_bits // 8)
        needed = height * (row_bytes + padding) - padding
        _require_bytes(device, data, needed)
        rows = np.zeros(height * (row_bytes + padding), np.uint8)
        rows[:needed] = data[:needed]
        samples = _samples(rows.reshape(height, -1)[:, :row_bytes].reshape(-1), pixels, width * height, row_bytes)
    else:  # packed pixels run on over the ends of rows
        needed = -(-row_bits * height // 8)
        _require_bytes(device, data, needed)
        samples = _unpack(data[:needed], pixels)[: width * height]
    shape = (height, width) if pixels.channels == 1 else (height, width, pixels.channels)
    image = samples.reshape(shape)
    return image if pixels.convert is None else np.asarray(cv2.cvtColor(image, pixels.convert))


def _require_bytes(device: str, data: NDArray[np.uint8], needed: int) -> None:
    if data.size < needed:
        raise IncompletePicture(device, f"{data.size} bytes of a picture came, {needed} make it whole")


def _samples(rows: NDArray[np.uint8], pixels: PixelFormat, count: int, row_bytes: int) -> NDArray[Any]:
    """The samples of whole rows of `row_bytes` each, one after the other."""
    if pixels.packing == "bytes":
        return rows if pixels.bits == 8 else rows.view("<u2")
    if row_bytes * 8 % pixels.bits_per_pixel == 0:
        return _unpack(rows, pixels)[:count]
    height = rows.size // row_bytes
    by_row = [_unpack(row, pixels)[: count // height] for row in rows.reshape(height, row_bytes)]
    return np.concatenate(by_row)


def _unpack(data: NDArray[np.uint8], pixels: PixelFormat) -> NDArray[np.uint16]:
    """Samples of packed bytes; up to a group more than there are, from the bytes that fill up the last group."""
    step = pixels.bits_per_pixel
    group = lcm(8, step) // 8 if pixels.packing == "lsb" else 3
    filled = np.zeros(-(-data.size // group) * group, np.uint8)
    filled[: data.size] = data
    parts = filled.reshape(-1, group)
    if pixels.packing == "gige":
        low_bits = pixels.bits - 8
        low = parts[:, 1].astype(np.uint16)
        first = parts[:, 0].astype(np.uint16) << low_bits | low & ((1 << low_bits) - 1)
        second = parts[:, 2].astype(np.uint16) << low_bits | low >> 4 & ((1 << low_bits) - 1)
        return np.stack([first, second], axis=1).reshape(-1)
    word = np.zeros(len(parts), np.uint64)
    for place in range(group):
        word |= parts[:, place].astype(np.uint64) << np.uint64(8 * place)
    columns = [(word >> np.uint64(step * place)) & np.uint64(pixels.white) for place in range(group * 8 // step)]
    return np.stack(columns, axis=1).astype(np.uint16).reshape(-1)
