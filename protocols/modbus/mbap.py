"""Splits a Modbus TCP byte stream into ADUs by the MBAP header."""

import struct
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass

from protocols.modbus.codes import MAX_PDU_BYTES
from protocols.modbus.errors import HeaderBroken

HEADER = struct.Struct(">HHHB")
MIN_LENGTH, MAX_LENGTH = 2, MAX_PDU_BYTES + 1
"""Limits of the length field, which counts the unit identifier and a PDU of at least its function code."""


@dataclass(frozen=True)
class Adu:
    """One request or reply with its header. `transaction` is chosen by the client and echoed."""

    transaction: int
    unit: int
    pdu: bytes

    def encode(self) -> bytes:
        return HEADER.pack(self.transaction, 0, len(self.pdu) + 1, self.unit) + self.pdu


class MbapReader:
    """Splits a stream into ADUs. An invalid header breaks the stream for good: nothing marks the next one."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._broken = ""

    @property
    def half_frame_bytes(self) -> int:
        """Number of buffered bytes of an incomplete frame."""
        return len(self._buffer)

    def feed(self, data: bytes) -> Iterator[Adu]:
        """Feed received bytes; yields the complete ADUs in order. Raises HeaderBroken after the last valid one."""
        if not self._broken:
            self._buffer += data
        while (adu := self._take()) is not None:
            yield adu

    def _take(self) -> Adu | None:
        """Take the next ADU from the buffer; None while it is incomplete."""
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
        """Why the buffer cannot begin a frame, found as early as its bytes allow; empty when it can."""
        buffer = self._buffer
        if any(buffer[2:4]):
            return f"protocol identifier {bytes(buffer[2:4]).hex(' ')} where 00 00 is expected"
        if len(buffer) >= 6:
            length = buffer[4] << 8 | buffer[5]
            if not MIN_LENGTH <= length <= MAX_LENGTH:
                return f"a length of {length}, where {MIN_LENGTH} to {MAX_LENGTH} are allowed"
        return ""


KEPT = 64
"""Requests that are remembered. A client that counts to less before it begins again does not number its requests."""


class RequestNumbers:
    """The latest requests of one connection.

    The Modbus TCP implementation guide asks for a new number for each request. Of a client that gives one number to two
    different requests nothing is recognised.
    """

    def __init__(self) -> None:
        self._latest: OrderedDict[int, bytes] = OrderedDict()
        self._numbered = True

    def is_repeated(self, adu: Adu) -> bool:
        """Note a request; True when the same one, with the same number, came before others that came since."""
        before = self._latest.get(adu.transaction)
        if before is not None and before != adu.pdu:
            self._numbered = False
        newest = next(reversed(self._latest), None) == adu.transaction
        if before is None:
            self._latest[adu.transaction] = adu.pdu
            if len(self._latest) > KEPT:
                self._latest.popitem(last=False)
        return self._numbered and before is not None and not newest
