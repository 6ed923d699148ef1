"""Client framing of both transports: adds the envelope to requests, extracts answers from received bytes.

Of one unit, on one connection at a time. `reset` discards the incomplete frame of the connection before; `feed` gives
the PDUs of the answers that are complete now, and raises HeaderBroken.
"""

from collections.abc import Iterable

from protocols.modbus.codes import ERROR_BIT, MAX_PDU_BYTES, Function
from protocols.modbus.mbap import Adu, MbapReader
from protocols.modbus.words import crc16_of_bytes

MAX_TRANSACTION = 65535
MIN_RTU_ANSWER = 5
"""Unit, function, exception code, CRC."""
RTU_ENVELOPE = 3
"""Unit, CRC."""


class TcpFraming:
    """Modbus TCP. Only an answer with the newest request's number counts; numbering continues over a new connection.

    `unit` 0 accepts any unit's answer, since a device without units answers with any.
    """

    def __init__(self, unit: int) -> None:
        self._unit, self._transaction = unit, 0
        self._reader = MbapReader()

    def reset(self) -> None:
        self._reader = MbapReader()

    def encode(self, pdu: bytes) -> bytes:
        self._transaction = self._transaction % MAX_TRANSACTION + 1
        return Adu(self._transaction, self._unit, pdu).encode()

    def feed(self, data: bytes) -> Iterable[bytes]:
        for adu in self._reader.feed(data):
            if adu.transaction == self._transaction and self._unit in (0, adu.unit):
                yield adu.pdu


class RtuFraming:
    """Modbus RTU, for requests of bits only. Frames are found by their CRC; bytes between them are skipped."""

    def __init__(self, unit: int) -> None:
        self._unit = unit
        self._buffer = bytearray()

    def reset(self) -> None:
        self._buffer.clear()

    def encode(self, pdu: bytes) -> bytes:
        frame = bytes([self._unit]) + pdu
        return frame + crc16_of_bytes(frame).to_bytes(2, "little")

    def feed(self, data: bytes) -> Iterable[bytes]:
        self._buffer += data
        while (found := self._find_frame()) is not None:
            begin, end = found
            pdu = bytes(self._buffer[begin + 1 : end - 2])
            del self._buffer[:end]
            yield pdu
        del self._buffer[: -(MAX_PDU_BYTES + RTU_ENVELOPE)]

    def _find_frame(self) -> tuple[int, int] | None:
        """Start and end of the first complete frame of this unit."""
        for begin in range(len(self._buffer) - MIN_RTU_ANSWER + 1):
            unit, function, third = self._buffer[begin : begin + 3]
            if unit != self._unit or function & ~ERROR_BIT not in (Function.READ_COILS, Function.READ_DISCRETE_INPUTS):
                continue
            end = begin + MIN_RTU_ANSWER + (0 if function & ERROR_BIT else third)
            frame = self._buffer[begin:end]
            if end <= len(self._buffer) and crc16_of_bytes(frame[:-2]) == int.from_bytes(frame[-2:], "little"):
                return begin, end
        return None


ClientFraming = TcpFraming | RtuFraming
