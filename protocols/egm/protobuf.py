"""The part of the protocol buffers wire format needed for doubles, integers and nested messages.

Source: protobuf.dev, "Encoding". Unknown fields are skipped, as the format requires.
"""

import struct
from collections.abc import Iterable, Iterator, Sequence

VARINT, FIXED64, BYTES, FIXED32 = 0, 1, 2, 5
MAX_VARINT_BYTES = 10
Value = int | float | bytes


class NotEgm(ValueError):
    """The bytes are truncated, or not the message that is expected; `why`: what packets of this kind are."""

    def __init__(self, what: str, why: str = "that are no EGM data of a robot") -> None:
        super().__init__(what)
        self.why = why


def fields(data: bytes) -> Iterator[tuple[int, Value]]:
    """Number and value of each field in order. Raises NotEgm."""
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
                raise NotEgm(f"field {number} is cut off")
            yield number, data[at : at + length]
            at += length
        elif kind == VARINT:
            value, at = _decode_varint(data, at)
            yield number, value
        elif kind == FIXED32 and at + 4 <= end:
            yield number, struct.unpack_from("<f", data, at)[0]
            at += 4
        else:
            raise NotEgm(f"field {number} is cut off, or of kind {kind}")


def _decode_varint(data: bytes, at: int) -> tuple[int, int]:
    value = 0
    for count in range(MAX_VARINT_BYTES):
        if at + count >= len(data):
            break
        byte = data[at + count]
        value |= (byte & 0x7F) << (7 * count)
        if byte < 0x80:
            return value, at + count + 1
    raise NotEgm("a number is cut off, or longer than 64 bits")


class Message:
    """A message's fields by number; of one that is repeated the last, but for `doubles`. All raise NotEgm."""

    def __init__(self, data: bytes) -> None:
        self._fields = tuple(fields(data))
        self._last = dict(self._fields)

    def __contains__(self, number: int) -> bool:
        return number in self._last

    def message(self, number: int) -> "Message":
        """The message in a field, which must be there."""
        value = self._last.get(number)
        if not isinstance(value, bytes):
            raise NotEgm(f"field {number} holds no message")
        return Message(value)

    def optional(self, number: int) -> "Message":
        """The message in a field; one without fields where there is none."""
        return self.message(number) if number in self._last else Message(b"")

    def integer(self, number: int) -> int:
        """The whole number in a field; 0 where there is none."""
        value = self._last.get(number, 0)
        if not isinstance(value, int):
            raise NotEgm(f"no whole number in field {number}")
        return value

    def double(self, number: int) -> float:
        """The double in a field, which must be there."""
        value = self._last.get(number)
        if not isinstance(value, float):
            raise NotEgm(f"no number in field {number}")
        return value

    def doubles(self, only: int | None = None) -> tuple[float, ...]:
        """Doubles in the order of their fields, repeated singly or packed; `only`: of that field alone."""
        found: list[float] = []
        for number, value in self._fields:
            if only in (None, number):
                found += _unpack(value) if isinstance(value, bytes) else (float(value),)
        return tuple(found)


def _unpack(packed: bytes) -> Sequence[float]:
    if len(packed) % 8:
        raise NotEgm(f"{len(packed)} bytes are no list of doubles")
    return struct.unpack(f"<{len(packed) // 8}d", packed)


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
