"""The interface of a server's registers and bits, and the execution of requests on it."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from protocols.modbus.codes import ERROR_BIT, ExceptionCode, Function
from protocols.modbus.errors import ModbusException
from protocols.modbus.requests import (
    COIL_OFF,
    COIL_ON,
    READ_DEVICE_IDENTIFICATION,
    MaskWrite,
    ReadBits,
    ReadIdentification,
    ReadWords,
    ReadWriteWords,
    Request,
    WriteBits,
    WriteWords,
    parse_request,
)


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
    try:
        return _execute(parse_request(pdu), bank, identification)
    except ModbusException as refused:
        function = pdu[0] if pdu else 0
        return bytes([function & 0x7F | ERROR_BIT, refused.code])


def _execute(request: Request, bank: Bank, identification: Identification) -> bytes:
    match request:
        case ReadBits(function, address, count):
            bits = sum(bool(bit) << place for place, bit in enumerate(bank.bits(function, address, count)))
            size = (count + 7) // 8
            return bytes([function, size]) + bits.to_bytes(size, "little")
        case ReadWords(function, address, count):
            return _words_reply(function, bank.words(function, address, count))
        case WriteBits(function, address, values):
            bank.write_bits(address, values)
            coil = COIL_ON if values[0] else COIL_OFF
            return struct.pack(">BHH", function, address, coil if function is Function.WRITE_COIL else len(values))
        case WriteWords(function, address, values):
            bank.write_words(address, values)
            single = function is Function.WRITE_REGISTER
            return struct.pack(">BHH", function, address, values[0] if single else len(values))
        case MaskWrite(address, and_mask, or_mask):
            (word,) = bank.words(Function.READ_HOLDING_REGISTERS, address, 1)
            bank.write_words(address, (request.apply(word),))
            return struct.pack(">BHHH", Function.MASK_WRITE_REGISTER, address, and_mask, or_mask)
        case ReadWriteWords(read_address, read_count, write_address, values):
            bank.words(Function.READ_HOLDING_REGISTERS, read_address, read_count)  # check the read before writing
            bank.write_words(write_address, values)
            read = bank.words(Function.READ_HOLDING_REGISTERS, read_address, read_count)
            return _words_reply(Function.READ_WRITE_REGISTERS, read)
        case ReadIdentification(level, object_id):
            return _identification_reply(level, object_id, identification)


def _words_reply(function: Function, words: Sequence[int]) -> bytes:
    return struct.pack(f">BB{len(words)}H", function, 2 * len(words), *words)


def _identification_reply(level: int, object_id: int, identification: Identification) -> bytes:
    """A stream restarts at object 0 when the requested object does not exist; a single object must exist."""
    objects = identification.objects(3 if level == 4 else level)
    if object_id not in objects:
        if level == 4:
            raise ModbusException(ExceptionCode.ILLEGAL_DATA_ADDRESS, f"there is no object {object_id}")
        object_id = 0
    numbers = [object_id] if level == 4 else [number for number in objects if number >= object_id]
    conformity = 0x82  # regular identification, as a stream and object by object
    head = [Function.ENCAPSULATED, READ_DEVICE_IDENTIFICATION, level, conformity, 0, 0, len(numbers)]
    return bytes(head) + b"".join(bytes([number, len(objects[number])]) + objects[number] for number in numbers)
