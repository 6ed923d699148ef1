"""A server's memory, and the answer to any request from it."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from protocols.modbus.codes import ERROR_BIT, ExceptionCode, Function
from protocols.modbus.errors import RequestRefused
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
    """Registers and bits. Every method raises RequestRefused; a refused write changes nothing."""

    def words(self, function: Function, address: int, count: int) -> Sequence[int]: ...

    def bits(self, function: Function, address: int, count: int) -> Sequence[bool]: ...

    def write_words(self, address: int, values: Sequence[int]) -> None: ...

    def write_bits(self, address: int, values: Sequence[bool]) -> None: ...


@dataclass(frozen=True)
class Identification:
    """What function 43 / 14 tells: basic objects 0 to 2, regular ones 3 to 6."""

    vendor: str
    product: str
    revision: str
    url: str = ""
    name: str = ""

    def objects(self, level: int) -> dict[int, bytes]:
        """By number, as far as the level reaches."""
        texts = {0: self.vendor, 1: self.product, 2: self.revision, 3: self.url, 4: self.name}
        return {number: text.encode("ascii", "replace") for number, text in texts.items() if number < 3 or level > 1}


def respond(pdu: bytes, bank: Bank, identification: Identification) -> bytes:
    """The PDU that answers a PDU; a refusal is an answer, too."""
    try:
        return _done(parse_request(pdu), bank, identification)
    except RequestRefused as refused:
        function = pdu[0] if pdu else 0
        return bytes([function & 0x7F | ERROR_BIT, refused.code])


def _done(request: Request, bank: Bank, identification: Identification) -> bytes:
    match request:
        case ReadBits(function, address, count):
            packed = packed_bits(bank.bits(function, address, count))
            return bytes([function, len(packed)]) + packed
        case ReadWords(function, address, count):
            return _words_reply(function, bank.words(function, address, count))
        case WriteBits(Function.WRITE_COIL, address, values):
            bank.write_bits(address, values)
            return struct.pack(">BHH", Function.WRITE_COIL, address, COIL_ON if values[0] else COIL_OFF)
        case WriteBits(function, address, values):
            bank.write_bits(address, values)
            return struct.pack(">BHH", function, address, len(values))
        case WriteWords(Function.WRITE_REGISTER, address, values):
            bank.write_words(address, values)
            return struct.pack(">BHH", Function.WRITE_REGISTER, address, values[0])
        case WriteWords(function, address, values):
            bank.write_words(address, values)
            return struct.pack(">BHH", function, address, len(values))
        case MaskWrite(address, and_mask, or_mask):
            (word,) = bank.words(Function.READ_HOLDING_REGISTERS, address, 1)
            bank.write_words(address, (request.applied(word),))
            return struct.pack(">BHHH", Function.MASK_WRITE_REGISTER, address, and_mask, or_mask)
        case ReadWriteWords(read_address, read_count, write_address, values):
            bank.words(Function.READ_HOLDING_REGISTERS, read_address, read_count)  # refused before anything is written
            bank.write_words(write_address, values)
            read = bank.words(Function.READ_HOLDING_REGISTERS, read_address, read_count)
            return _words_reply(Function.READ_WRITE_REGISTERS, read)
        case ReadIdentification(level, object_id):
            return _identified(level, object_id, identification)


def packed_bits(bits: Sequence[bool]) -> bytes:
    """Eight to a byte, the first in the lowest bit."""
    packed = bytearray((len(bits) + 7) // 8)
    for i, bit in enumerate(bits):
        packed[i // 8] |= bool(bit) << (i % 8)
    return bytes(packed)


def _words_reply(function: Function, words: Sequence[int]) -> bytes:
    return struct.pack(f">BB{len(words)}H", function, 2 * len(words), *words)


def _identified(level: int, object_id: int, identification: Identification) -> bytes:
    """Streams begin again at object 0 when the one asked for is not there; single objects must be."""
    objects = identification.objects(3 if level == 4 else level)
    if object_id not in objects:
        if level == 4:
            raise RequestRefused(ExceptionCode.ILLEGAL_DATA_ADDRESS, f"there is no object {object_id}")
        object_id = 0
    told = [object_id] if level == 4 else [number for number in objects if number >= object_id]
    conformity = 0x82  # regular, as stream and one by one
    head = [Function.ENCAPSULATED, READ_DEVICE_IDENTIFICATION, level, conformity, 0, 0, len(told)]
    return bytes(head) + b"".join(bytes([number, len(objects[number])]) + objects[number] for number in told)
