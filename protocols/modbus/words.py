"""Numbers and text in 16-bit registers. The order of the two words of a long number is the one thing PLCs differ in."""

import struct
from collections.abc import Iterable, Sequence
from enum import StrEnum

Words = tuple[int, ...]


class WordOrder(StrEnum):
    """Of numbers that take two registers; the bytes inside a register are always big-endian."""

    HIGH_FIRST = "high-first"  # ABCD
    LOW_FIRST = "low-first"  # CDAB


def float_words(value: float, order: WordOrder) -> Words:
    """A float32 in two registers; what is beyond its range becomes the largest there is."""
    limit = 3.4028234663852886e38
    return _ordered(struct.pack(">f", min(max(value, -limit), limit)), order)


def integer_words(value: int, order: WordOrder) -> Words:
    """An int32 in two registers, held at its limits."""
    return _ordered(struct.pack(">i", min(max(value, -(2**31)), 2**31 - 1)), order)


def unsigned_words(value: int, order: WordOrder) -> Words:
    """A uint32 in two registers, held at its limits."""
    return _ordered(struct.pack(">I", min(max(value, 0), 2**32 - 1)), order)


def text_words(text: str, registers: int) -> Words:
    """ASCII, two characters a register, the first in the high byte; filled with zeros, cut at the end."""
    content = text.encode("ascii", "replace")[: 2 * registers].ljust(2 * registers, b"\0")
    return struct.unpack(f">{registers}H", content)


def float_of(words: Sequence[int], order: WordOrder) -> float:
    """The float32 in two registers."""
    value: float = struct.unpack(">f", _bytes(words, order))[0]
    return value


def integer_of(words: Sequence[int], order: WordOrder) -> int:
    """The int32 in two registers."""
    value: int = struct.unpack(">i", _bytes(words, order))[0]
    return value


def unsigned_of(words: Sequence[int], order: WordOrder) -> int:
    """The uint32 in two registers."""
    value: int = struct.unpack(">I", _bytes(words, order))[0]
    return value


def text_of(words: Sequence[int]) -> str:
    """The text up to its first zero."""
    return struct.pack(f">{len(words)}H", *words).split(b"\0")[0].decode("ascii", "replace")


def crc16(words: Iterable[int]) -> int:
    """CRC-16/MODBUS (polynomial 8005 reflected, start ffff) over the registers' bytes, high byte first."""
    crc = 0xFFFF
    for word in words:
        for byte in (word >> 8, word & 0xFF):
            crc ^= byte
            for _ in range(8):
                crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    return crc


def _ordered(four: bytes, order: WordOrder) -> Words:
    high, low = struct.unpack(">HH", four)
    return (high, low) if order is WordOrder.HIGH_FIRST else (low, high)


def _bytes(words: Sequence[int], order: WordOrder) -> bytes:
    high, low = words if order is WordOrder.HIGH_FIRST else reversed(words)
    return struct.pack(">HH", high, low)
