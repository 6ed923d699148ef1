"""The header of Modbus TCP: bytes in, requests out, however the bytes are cut."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass

from protocols.modbus.codes import PDU_MOST
from protocols.modbus.errors import HeaderBroken

HEADER = struct.Struct(">HHHB")
LENGTH_LEAST, LENGTH_MOST = 2, PDU_MOST + 1
"""Of what follows the length field: the unit, and a PDU of at least its function code."""


@dataclass(frozen=True)
class Adu:
    """One request or reply in its envelope. `transaction` is the client's number, echoed."""

    transaction: int
    unit: int
    pdu: bytes

    def encode(self) -> bytes:
        """The bytes on the wire."""
        return HEADER.pack(self.transaction, 0, len(self.pdu) + 1, self.unit) + self.pdu


class MbapReader:
    """A header that cannot be one breaks the stream for good: there is no way to find the next one."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._broken = ""

    @property
    def half_frame_bytes(self) -> int:
        """How many bytes of an unfinished frame wait here."""
        return len(self._buffer)

    def feed(self, data: bytes) -> Iterator[Adu]:
        """What is complete now, in the order it came. Raises HeaderBroken behind the last whole frame."""
        if not self._broken:
            self._buffer += data
        while (adu := self._take()) is not None:
            yield adu

    def _take(self) -> Adu | None:
        """The next whole frame, None while it is not whole."""
        if self._broken:
            raise HeaderBroken(self._broken)
        fault = self._fault()
        if fault:
            self._broken = fault
            self._buffer.clear()
            raise HeaderBroken(fault)
        if len(self._buffer) < HEADER.size:
            return None
        transaction, _, length, unit = HEADER.unpack_from(self._buffer)
        end = HEADER.size - 1 + length
        if len(self._buffer) < end:
            return None
        pdu = bytes(self._buffer[HEADER.size : end])
        del self._buffer[:end]
        return Adu(transaction, unit, pdu)

    def _fault(self) -> str:
        """Why the buffer begins no frame, as early as its bytes tell; empty when it does."""
        buffer = self._buffer
        if any(buffer[2:4]):
            return f"protocol identifier {bytes(buffer[2:4]).hex(' ')} where 00 00 is expected"
        if len(buffer) >= 6:
            length = buffer[4] << 8 | buffer[5]
            if not LENGTH_LEAST <= length <= LENGTH_MOST:
                return f"a length of {length}, where {LENGTH_LEAST} to {LENGTH_MOST} are allowed"
        return ""
