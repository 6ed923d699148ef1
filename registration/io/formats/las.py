"""Header of an uncompressed LAS file (ASPRS, LAS 1.4-R15), as far as moving its integer coordinates needs.

All record formats begin with X, Y, Z as 32-bit integers; everything else in the file can be copied unchanged.
"""

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np

from registration.errors import CloudFormatError, CloudTruncated, CloudUnsupported
from registration.io.durable_file import GuardedFile
from registration.points.layout import Array
from registration.points.rigid_motion import RigidMotion

HEADER_BYTES = 375
"""Header length of version 1.4, the longest."""
MIN_HEADER_BYTES = 227
SIGNATURE, VERSION, SIZES, LEGACY_COUNT, SCALES, BOUNDS, LONG_RECORDS, LONG_COUNT = 0, 24, 94, 107, 131, 179, 235, 247
"""Byte offsets of the fields."""
RECORD_HEAD, LONG_RECORD_HEAD = 54, 60
"""Minimum size of a variable length record, before and after the points."""

COMPRESSED = 0xC0
"""Bits of the record format set by LAZ."""
MIN_RECORD_BYTES = 20
INT32_LIMIT = 2**31 - 1
LENGTH_LIMIT = 1e12
"""Upper bound of any length and of any inverse scale in a LAS file; NaN violates it."""
FIX = "copy or write the file again"


@dataclass(frozen=True, eq=False)
class LasFrame:
    """Maps integers to lengths: `scales` and `offsets` (3,); `least` and `most` (3,) are the points' bounds."""

    scales: Array
    offsets: Array
    lower: Array
    upper: Array


@dataclass(frozen=True, eq=False)
class LasHeader:
    """Points start at byte `begin`, each of `record_bytes`. `compressed`: LAZ under a .las name."""

    frame: LasFrame
    begin: int
    record_bytes: int
    count: int
    compressed: bool

    @property
    def dtype(self) -> np.dtype[Any]:
        """Record type with X, Y, Z and the rest as bytes."""
        rest = self.record_bytes - 12
        return np.dtype([("X", "<i4"), ("Y", "<i4"), ("Z", "<i4"), ("rest", f"V{rest}")])


def parse_header(prefix: bytes, size: int, file: str) -> LasHeader:
    """Parse a file's first HEADER_BYTES, given its size. Raises CloudFormatError, CloudTruncated."""
    if len(prefix) < MIN_HEADER_BYTES:
        raise CloudTruncated(file, "header", f"the file ends after {len(prefix)} bytes", FIX)
    if prefix[:4] != b"LASF":
        raise CloudFormatError(file, "byte 0", "this is not a LAS file", "check the file's type")
    header_bytes, begin, records, kind, record_bytes, count = struct.unpack_from("<HIIBHI", prefix, SIZES)
    if prefix[VERSION + 1] >= 4 and header_bytes >= LONG_COUNT + 8 <= len(prefix):
        at, long_records, count = struct.unpack_from("<QIQ", prefix, LONG_RECORDS)
        _require_room("extended records", long_records, LONG_RECORD_HEAD, size - at, file)
    if record_bytes < MIN_RECORD_BYTES or not MIN_HEADER_BYTES <= header_bytes <= begin:
        what = f"records of {record_bytes} bytes after a header of {header_bytes} at byte {begin} are not possible"
        raise CloudFormatError(file, "header", what, FIX)
    if begin > size:
        raise CloudTruncated(file, f"byte {size}", f"the points begin at byte {begin}, but the file ends here", FIX)
    _require_room("variable length records", records, RECORD_HEAD, min(begin, size) - header_bytes, file)
    compressed = bool(kind & COMPRESSED)
    if not compressed and begin + count * record_bytes > size:
        what = f"the header promises {count} points in {count * record_bytes} bytes, but {size - begin} follow"
        raise CloudTruncated(file, f"byte {size}", what, FIX)
    numbers = np.frombuffer(prefix, "<f8", 12, SCALES)
    no_scale = count > 0 and not (np.abs(numbers[:3]) > 1 / LENGTH_LIMIT).all()
    if no_scale or not (np.abs(numbers[:6]) < LENGTH_LIMIT).all():
        raise CloudFormatError(file, "header", "scales or offsets are not valid lengths", FIX)
    bounds = numbers[6:].reshape(3, 2)  # max x, min x, max y, ...
    frame = LasFrame(numbers[:3].copy(), numbers[3:6].copy(), bounds[:, 1].copy(), bounds[:, 0].copy())
    return LasHeader(frame, begin, record_bytes, count, compressed)


def _require_room(what: str, number: int, least_bytes: int, room: int, file: str) -> None:
    """Refuse more records than fit: a library would allocate as many as the header promises."""
    if number * least_bytes > max(0, room):
        raise CloudFormatError(file, "header", f"it promises {number} {what} in {max(0, room)} bytes", FIX)


def read_whole_header(file: GuardedFile) -> LasHeader:
    """Parse the header at the start of a file and rewind it. Raises CloudFormatError, CloudTruncated."""
    size = file.seek(0, 2)
    file.seek(0)
    header = parse_header(file.read(HEADER_BYTES), size, file.name)
    file.seek(0)
    return header


def move_frame(frame: LasFrame, motion: RigidMotion, file: str) -> tuple[LasFrame, Array]:
    """The frame for moved points, without bounds, and the matrix (3, 4) from old integers to new ones.

    Raises CloudFormatError.
    """
    if not all((np.abs(bound) < LENGTH_LIMIT).all() for bound in (frame.lower, frame.upper)):
        raise CloudFormatError(file, "header", "bounds are not valid lengths", FIX)
    if not (frame.scales > 1 / LENGTH_LIMIT).all():
        raise CloudFormatError(file, "header", "scales are not valid lengths", FIX)
    centre = frame.lower / 2 + frame.upper / 2
    scale = float(frame.scales.max()) * float(np.linalg.norm(motion.matrix[:, 0]))
    offset = np.rint(motion.matrix[:, :3] @ centre + motion.matrix[:, 3])
    linear = motion.matrix[:, :3] * frame.scales / scale
    shift = (motion.matrix[:, :3] @ frame.offsets + motion.matrix[:, 3] - offset) / scale
    matrix: Array = np.column_stack([linear, shift])
    return LasFrame(np.full(3, scale), offset, frame.lower, frame.upper), matrix


def require_fit(least: Array, most: Array, file: str) -> None:
    """Check bounds, since OpenCV saturates integers that do not fit. Raises CloudUnsupported."""
    if (least <= -INT32_LIMIT - 1).any() or (most >= INT32_LIMIT).any():
        what = "the moved points do not fit LAS's 32-bit integers at this scale"
        raise CloudUnsupported(file, "points", what, "write a PLY instead")


def rewrite_header(prefix: bytes, frame: LasFrame) -> bytes:
    bounds = np.stack([frame.upper, frame.lower], axis=1).ravel()
    numbers = np.concatenate([frame.scales, frame.offsets, bounds])
    return prefix[:SCALES] + numbers.astype("<f8").tobytes() + prefix[SCALES + numbers.nbytes :]
