"""Requests as frozen dataclasses, and their decoding from a PDU."""

import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from protocols.modbus.codes import (
    MAX_READ_BITS,
    MAX_READ_WORDS,
    MAX_READ_WRITE_WORDS,
    MAX_WRITE_BITS,
    MAX_WRITE_WORDS,
    ExceptionCode,
    Function,
)
from protocols.modbus.errors import ModbusException

COIL_ON, COIL_OFF = 0xFF00, 0x0000
READ_DEVICE_IDENTIFICATION = 14
"""MEI type 14, the only encapsulated transport supported."""


@dataclass(frozen=True)
class ReadBits:
    """Function 1 (coils) or 2 (discrete inputs)."""

    function: Function
    address: int
    count: int


@dataclass(frozen=True)
class ReadWords:
    """Function 3 (holding registers) or 4 (input registers)."""

    function: Function
    address: int
    count: int


@dataclass(frozen=True)
class WriteBits:
    """Function 5 (one coil) or 15 (several)."""

    function: Function
    address: int
    values: tuple[bool, ...]


@dataclass(frozen=True)
class WriteWords:
    """Function 6 (one register) or 16 (several)."""

    function: Function
    address: int
    values: tuple[int, ...]


@dataclass(frozen=True)
class MaskWrite:
    """Function 22: the register becomes (it AND and_mask) OR (or_mask AND NOT and_mask)."""

    address: int
    and_mask: int
    or_mask: int

    def apply(self, word: int) -> int:
        return (word & self.and_mask) | (self.or_mask & ~self.and_mask & 0xFFFF)


@dataclass(frozen=True)
class ReadWriteWords:
    """Function 23: write first, then read."""

    read_address: int
    read_count: int
    write_address: int
    values: tuple[int, ...]


@dataclass(frozen=True)
class ReadIdentification:
    """Function 43 / 14. `level` 1 basic, 2 regular, 3 extended: a stream from `object_id` on; 4: that object only."""

    level: int
    object_id: int


Request = ReadBits | ReadWords | WriteBits | WriteWords | MaskWrite | ReadWriteWords | ReadIdentification


def parse_request(pdu: bytes) -> Request:
    """Decode the request in a PDU. Raises ModbusException with the exception code of the specification."""
    if not pdu:
        raise ModbusException(ExceptionCode.ILLEGAL_FUNCTION, "an empty request")
    parse = _PARSERS.get(pdu[0])
    if parse is None:
        raise ModbusException(ExceptionCode.ILLEGAL_FUNCTION, f"function {pdu[0]} is not supported")
    try:
        return parse(Function(pdu[0]), pdu[1:])
    except struct.error:
        raise _bad_value(f"function {pdu[0]} with {len(pdu) - 1} bytes of data") from None


def words_of(data: bytes) -> tuple[int, ...]:
    """Decode big-endian registers."""
    return struct.unpack(f">{len(data) // 2}H", data)


def bits_of(data: bytes, count: int) -> tuple[bool, ...]:
    """Unpack `count` bits; the first is the lowest of the first byte."""
    return tuple(bool(data[i // 8] >> (i % 8) & 1) for i in range(count))


def _bad_value(what: str) -> ModbusException:
    return ModbusException(ExceptionCode.ILLEGAL_DATA_VALUE, what)


def _require_count(count: int, most: int) -> None:
    if not 1 <= count <= most:
        raise _bad_value(f"a quantity of {count}, where 1 to {most} are allowed")


def _require_bytes(promised: int, data: bytes, wanted: int) -> None:
    if promised != wanted or len(data) != wanted:
        raise _bad_value(f"{len(data)} bytes of values, {promised} promised, {wanted} needed")


def _parse_read(kind: type[ReadBits | ReadWords], most: int, function: Function, data: bytes) -> Request:
    address, count = struct.unpack(">HH", data)
    _require_count(count, most)
    return kind(function, address, count)


def _parse_write_coil(function: Function, data: bytes) -> Request:
    address, value = struct.unpack(">HH", data)
    if value not in (COIL_ON, COIL_OFF):
        raise _bad_value(f"a coil of {value:#06x}, where ff00 or 0000 are allowed")
    return WriteBits(function, address, (value == COIL_ON,))


def _parse_write_register(function: Function, data: bytes) -> Request:
    address, value = struct.unpack(">HH", data)
    return WriteWords(function, address, (value,))


def _parse_write_coils(function: Function, data: bytes) -> Request:
    address, count, promised = struct.unpack(">HHB", data[:5])
    _require_count(count, MAX_WRITE_BITS)
    _require_bytes(promised, data[5:], (count + 7) // 8)
    return WriteBits(function, address, bits_of(data[5:], count))


def _parse_write_registers(function: Function, data: bytes) -> Request:
    address, count, promised = struct.unpack(">HHB", data[:5])
    _require_count(count, MAX_WRITE_WORDS)
    _require_bytes(promised, data[5:], 2 * count)
    return WriteWords(function, address, words_of(data[5:]))


def _parse_read_write(_function: Function, data: bytes) -> Request:
    read_address, read_count, write_address, write_count, promised = struct.unpack(">HHHHB", data[:9])
    _require_count(read_count, MAX_READ_WORDS)
    _require_count(write_count, MAX_READ_WRITE_WORDS)
    _require_bytes(promised, data[9:], 2 * write_count)
    return ReadWriteWords(read_address, read_count, write_address, words_of(data[9:]))


def _parse_identification(_function: Function, data: bytes) -> Request:
    kind, level, object_id = struct.unpack(">BBB", data)
    if kind != READ_DEVICE_IDENTIFICATION:
        raise ModbusException(ExceptionCode.ILLEGAL_FUNCTION, f"encapsulated transport {kind} is not supported")
    if not 1 <= level <= 4:
        raise _bad_value(f"a level of identification of {level}, where 1 to 4 are allowed")
    return ReadIdentification(level, object_id)


_PARSERS: dict[int, Callable[[Function, bytes], Request]] = {
    Function.READ_COILS: partial(_parse_read, ReadBits, MAX_READ_BITS),
    Function.READ_DISCRETE_INPUTS: partial(_parse_read, ReadBits, MAX_READ_BITS),
    Function.READ_HOLDING_REGISTERS: partial(_parse_read, ReadWords, MAX_READ_WORDS),
    Function.READ_INPUT_REGISTERS: partial(_parse_read, ReadWords, MAX_READ_WORDS),
    Function.WRITE_COIL: _parse_write_coil,
    Function.WRITE_REGISTER: _parse_write_register,
    Function.WRITE_COILS: _parse_write_coils,
    Function.WRITE_REGISTERS: _parse_write_registers,
    Function.MASK_WRITE_REGISTER: lambda _, data: MaskWrite(*struct.unpack(">HHH", data)),
    Function.READ_WRITE_REGISTERS: _parse_read_write,
    Function.ENCAPSULATED: _parse_identification,
}
