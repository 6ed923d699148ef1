"""Bits in bytes; numbers and text in 16-bit registers. PLCs differ only in the order of the two words of a number."""

import struct
from collections.abc import Iterable, Sequence
from enum import StrEnum

Words = tuple[int, ...]


class WordOrder(StrEnum):
    """Order of the two registers of a 32-bit number; bytes inside a register are always big-endian."""

    HIGH_FIRST = "high-first"  # ABCD
    LOW_FIRST = "low-first"  # CDAB


def bits_of(data: bytes, count: int) -> tuple[bool, ...]:
    """Unpack `count` bits; the first is the lowest of the first byte."""
    return tuple(bool(data[i // 8] >> (i % 8) & 1) for i in range(count))


def float_words(value: float, order: WordOrder) -> Words:
    """Encode a float32 in two registers, clipped to its range."""
    limit = 3.4028234663852886e38
    return _reorder(struct.pack(">f", min(max(value, -limit), limit)), order)


def integer_words(value: int, order: WordOrder) -> Words:
    """Encode an int32 in two registers, clipped to its range."""
    return _reorder(struct.pack(">i", min(max(value, -(2**31)), 2**31 - 1)), order)


def unsigned_words(value: int, order: WordOrder) -> Words:
    """Encode a uint32 in two registers, clipped to its range."""
    return _reorder(struct.pack(">I", min(max(value, 0), 2**32 - 1)), order)


def text_words(text: str, registers: int) -> Words:
    """Encode ASCII, two characters a register, the first in the high byte; padded with zeros or truncated."""
    content = text.encode("ascii", "replace")[: 2 * registers].ljust(2 * registers, b"\0")
    return struct.unpack(f">{registers}H", content)


def unsigned_of(words: Sequence[int], order: WordOrder) -> int:
    """Decode a uint32 from two registers."""
    value: int = struct.unpack(">I", _bytes(words, order))[0]
    return value


def text_of(words: Sequence[int]) -> str:
    """Decode text up to its first zero."""
    return struct.pack(f">{len(words)}H", *words).split(b"\0")[0].decode("ascii", "replace")


def crc16(words: Iterable[int]) -> int:
    """CRC-16/MODBUS over the registers' bytes, high byte first."""
    return crc16_of_bytes(byte for word in words for byte in (word >> 8, word & 0xFF))


def crc16_of_bytes(data: Iterable[int]) -> int:
    """CRC-16/MODBUS (polynomial 8005 reflected, start ffff); on an RTU line its low byte comes first."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    return crc


def _reorder(four: bytes, order: WordOrder) -> Words:
    high, low = struct.unpack(">HH", four)
    return (high, low) if order is WordOrder.HIGH_FIRST else (low, high)


def _bytes(words: Sequence[int], order: WordOrder) -> bytes:
    high, low = words if order is WordOrder.HIGH_FIRST else reversed(words)
    return struct.pack(">HH", high, low)
