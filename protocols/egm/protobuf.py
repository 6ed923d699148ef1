"""The part of the protocol buffers wire format needed for doubles, integers and nested messages.

Source: protobuf.dev, "Encoding". Unknown fields are skipped, as the format requires.
"""

import struct
from collections.abc import Iterable, Iterator, Sequence

VARINT, FIXED64, BYTES, FIXED32 = 0, 1, 2, 5
MAX_VARINT_BYTES = 10
Value = int | float | bytes


class NotProtobuf(ValueError):
    """The bytes are truncated or not a message."""


def fields(data: bytes) -> Iterator[tuple[int, Value]]:
    """Number and value of each field in order. Raises NotProtobuf."""
    at, end = 0, len(data)
    while at < end:
        key, at = _decode_varint(data, at)
        number, kind = key >> 3, key & 7
        if kind == FIXED64 and at + 8 <= end:
            yield number, struct.unpack_from("<d", data, at)[0]
            at += 8
        elif kind == BYTES:
            length, at = _decode_varint(data, at)
            if at + length > end:
                raise NotProtobuf(f"field {number} is cut off")
            yield number, data[at : at + length]
            at += length
        elif kind == VARINT:
            value, at = _decode_varint(data, at)
            yield number, value
        elif kind == FIXED32 and at + 4 <= end:
            yield number, struct.unpack_from("<f", data, at)[0]
            at += 4
        else:
            raise NotProtobuf(f"field {number} is cut off, or of kind {kind}")


def _decode_varint(data: bytes, at: int) -> tuple[int, int]:
    value = 0
    for count in range(MAX_VARINT_BYTES):
        if at + count >= len(data):
            break
        byte = data[at + count]
        value |= (byte & 0x7F) << (7 * count)
        if byte < 0x80:
            return value, at + count + 1
    raise NotProtobuf("a number is cut off, or longer than 64 bits")


def doubles_by_tags(data: bytes, numbers: Sequence[int]) -> tuple[float, ...] | None:
    """Values of a message that consists of exactly these double fields in this order (fast path); otherwise None."""
    if len(data) != 9 * len(numbers):
        return None
    flat = struct.unpack("<" + "Bd" * len(numbers), data)
    keys = tuple(number << 3 | FIXED64 for number in numbers)
    return flat[1::2] if flat[::2] == keys else None


def doubles(data: bytes) -> list[float]:
    """Decode a packed list of doubles. Raises NotProtobuf."""
    if len(data) % 8:
        raise NotProtobuf(f"{len(data)} bytes are no list of doubles")
    return list(struct.unpack(f"<{len(data) // 8}d", data))


def integer_field(number: int, value: int) -> bytes:
    """Encode a field with an integer that is not negative."""
    return _key(number, VARINT) + _encode_varint(value)


def double_field(number: int, value: float) -> bytes:
    return _key(number, FIXED64) + struct.pack("<d", value)


def message_field(number: int, parts: Iterable[bytes]) -> bytes:
    content = b"".join(parts)
    return _key(number, BYTES) + _encode_varint(len(content)) + content


def _key(number: int, kind: int) -> bytes:
    return _encode_varint(number << 3 | kind)


def _encode_varint(value: int) -> bytes:
    packed = bytearray()
    while value > 0x7F:
        packed.append(value & 0x7F | 0x80)
        value >>= 7
    packed.append(value)
    return bytes(packed)
