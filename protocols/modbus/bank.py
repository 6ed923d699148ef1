"""The interface of a server's registers and bits, and the answers to requests for them."""

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from protocols.modbus.codes import (
    ERROR_BIT,
    MAX_READ_BITS,
    MAX_READ_WORDS,
    MAX_READ_WRITE_WORDS,
    MAX_WRITE_BITS,
    MAX_WRITE_WORDS,
    ExceptionCode,
    Function,
)
from protocols.modbus.errors import ModbusException
from protocols.modbus.words import bits_of

COIL_ON, COIL_OFF = 0xFF00, 0x0000
READ_DEVICE_IDENTIFICATION = 14
"""MEI type 14, the only encapsulated transport supported."""
ONE_OBJECT = 4
"""Level of identification that asks for one object; those below ask for a stream of them."""
CONFORMITY = 0x82
"""Regular identification, as a stream and object by object."""


class Bank(Protocol):
    """Registers and bits of a server. Every method raises ModbusException; a refused write changes nothing."""

    def words(self, function: Function, address: int, count: int) -> Sequence[int]: ...

    def bits(self, function: Function, address: int, count: int) -> Sequence[bool]: ...

    def write_words(self, address: int, values: Sequence[int]) -> None: ...

    def write_bits(self, address: int, values: Sequence[bool]) -> None: ...


@dataclass(frozen=True)
class Identification:
    """Reply to function 43 / 14: basic objects 0 to 2, regular objects 3 to 6."""

    vendor: str
    product: str
    revision: str
    url: str = ""
    name: str = ""

    def objects(self, level: int) -> dict[int, bytes]:
        """Objects by number, up to the requested level."""
        texts = {0: self.vendor, 1: self.product, 2: self.revision, 3: self.url, 4: self.name}
        return {number: text.encode("ascii", "replace") for number, text in texts.items() if number < 3 or level > 1}


def respond(pdu: bytes, bank: Bank, identification: Identification) -> bytes:
    """Execute a request PDU and return the reply PDU, which may be an exception reply."""
    function, data = (pdu[0] if pdu else 0), pdu[1:]
    try:
        if function == Function.ENCAPSULATED:
            return bytes([function]) + _identify(data, identification)
        if function not in _ANSWERS:
            raise ModbusException(ExceptionCode.ILLEGAL_FUNCTION, f"function {function} is not supported")
        return bytes([function]) + _ANSWERS[function](bank, Function(function), data)
    except ModbusException as refused:
        code = refused.code
    return bytes([function & ~ERROR_BIT | ERROR_BIT, code])


# What follows the function code in the reply. Each raises ModbusException.


def _read_bits(bank: Bank, function: Function, data: bytes) -> bytes:
    address, count = _range(data, MAX_READ_BITS)
    bits = sum(bool(bit) << place for place, bit in enumerate(bank.bits(function, address, count)))
    size = (count + 7) // 8
    return bytes([size]) + bits.to_bytes(size, "little")


def _read_words(bank: Bank, function: Function, data: bytes) -> bytes:
    words = bank.words(function, *_range(data, MAX_READ_WORDS))
    return struct.pack(f">B{len(words)}H", 2 * len(words), *words)


def _write_coil(bank: Bank, function: Function, data: bytes) -> bytes:
    address, value = _unpack(">HH", data)
    if value not in (COIL_ON, COIL_OFF):
        raise _bad_value(f"a coil of {value:#06x}, where ff00 or 0000 are allowed")
    bank.write_bits(address, [value == COIL_ON])
    return data


def _write_register(bank: Bank, function: Function, data: bytes) -> bytes:
    address, value = _unpack(">HH", data)
    bank.write_words(address, [value])
    return data


def _write_coils(bank: Bank, function: Function, data: bytes) -> bytes:
    address, count, values = _values(data, MAX_WRITE_BITS, bits_each=1)
    bank.write_bits(address, bits_of(values, count))
    return data[:4]


def _write_registers(bank: Bank, function: Function, data: bytes) -> bytes:
    address, count, values = _values(data, MAX_WRITE_WORDS, bits_each=16)
    bank.write_words(address, struct.unpack(f">{count}H", values))
    return data[:4]


def _mask_write(bank: Bank, function: Function, data: bytes) -> bytes:
    """The register becomes (it AND and_mask) OR (or_mask AND NOT and_mask)."""
    address, and_mask, or_mask = _unpack(">HHH", data)
    (word,) = bank.words(Function.READ_HOLDING_REGISTERS, address, 1)
    bank.write_words(address, [(word & and_mask) | (or_mask & ~and_mask)])
    return data


def _read_write(bank: Bank, function: Function, data: bytes) -> bytes:
    """Write first, then read; what cannot be read is not written either."""
    read, (address, count, values) = data[:4], _values(data[4:], MAX_READ_WRITE_WORDS, bits_each=16)
    _read_words(bank, Function.READ_HOLDING_REGISTERS, read)
    bank.write_words(address, struct.unpack(f">{count}H", values))
    return _read_words(bank, Function.READ_HOLDING_REGISTERS, read)


def _identify(data: bytes, identification: Identification) -> bytes:
    """A stream restarts at object 0 when the requested object does not exist; a single object must exist."""
    kind, level, object_id = _unpack(">BBB", data)
    if kind != READ_DEVICE_IDENTIFICATION:
        raise ModbusException(ExceptionCode.ILLEGAL_FUNCTION, f"encapsulated transport {kind} is not supported")
    if not 1 <= level <= ONE_OBJECT:
        raise _bad_value(f"a level of identification of {level}, where 1 to {ONE_OBJECT} are allowed")
    objects = identification.objects(level)
    if level == ONE_OBJECT and object_id not in objects:
        raise ModbusException(ExceptionCode.ILLEGAL_DATA_ADDRESS, f"there is no object {object_id}")
    first = object_id if object_id in objects else 0
    numbers = [first] if level == ONE_OBJECT else [number for number in objects if number >= first]
    head = [kind, level, CONFORMITY, 0, 0, len(numbers)]
    return bytes(head) + b"".join(bytes([number, len(objects[number])]) + objects[number] for number in numbers)


_ANSWERS: dict[int, Callable[[Bank, Function, bytes], bytes]] = {
    Function.READ_COILS: _read_bits,
    Function.READ_DISCRETE_INPUTS: _read_bits,
    Function.READ_HOLDING_REGISTERS: _read_words,
    Function.READ_INPUT_REGISTERS: _read_words,
    Function.WRITE_COIL: _write_coil,
    Function.WRITE_REGISTER: _write_register,
    Function.WRITE_COILS: _write_coils,
    Function.WRITE_REGISTERS: _write_registers,
    Function.MASK_WRITE_REGISTER: _mask_write,
    Function.READ_WRITE_REGISTERS: _read_write,
}


def _unpack(form: str, data: bytes) -> tuple[int, ...]:
    try:
        return struct.unpack(form, data)
    except struct.error:
        raise _bad_value(f"{len(data)} bytes, where {struct.calcsize(form)} are needed") from None


def _range(data: bytes, most: int) -> tuple[int, int]:
    """Address and quantity of a request that reads."""
    address, count = _unpack(">HH", data)
    _require_count(count, most)
    return address, count


def _values(data: bytes, most: int, bits_each: int) -> tuple[int, int, bytes]:
    """Address, quantity and values, of `bits_each`, of a request that writes several."""
    address, count, promised = _unpack(">HHB", data[:5])
    _require_count(count, most)
    wanted = (count * bits_each + 7) // 8
    if not promised == len(data) - 5 == wanted:
        raise _bad_value(f"{len(data) - 5} bytes of values, {promised} promised, {wanted} needed")
    return address, count, data[5:]


def _require_count(count: int, most: int) -> None:
    if not 1 <= count <= most:
        raise _bad_value(f"a quantity of {count}, where 1 to {most} are allowed")


def _bad_value(what: str) -> ModbusException:
    return ModbusException(ExceptionCode.ILLEGAL_DATA_VALUE, what)
