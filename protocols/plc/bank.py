"""The PLC's registers as the memory of a Modbus server, for a client with or without write access."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from protocols.modbus.codes import ExceptionCode, Function
from protocols.modbus.errors import ModbusException
from protocols.modbus.words import Words
from protocols.plc.registers import CONTROL, SIZE, STATUS, WRITABLE

BITS = 16
"""Coils are the bits of the control register, discrete inputs the bits of the status register."""


@dataclass(frozen=True)
class PlcBank:
    """`image` returns the current registers; `write` receives the writable ones and which addresses were written."""

    image: Callable[[], Words]
    write: Callable[[Words, range], None]
    may_write: bool

    def words(self, function: Function, address: int, count: int) -> Sequence[int]:
        _require_inside(address, count, SIZE)
        return self.image()[address : address + count]

    def bits(self, function: Function, address: int, count: int) -> Sequence[bool]:
        _require_inside(address, count, BITS)
        word = self.image()[CONTROL if function is Function.READ_COILS else STATUS]
        return [bool(word >> bit & 1) for bit in range(address, address + count)]

    def write_words(self, address: int, values: Sequence[int]) -> None:
        self._require_writer()
        if not WRITABLE.issuperset(range(address, address + len(values))):
            raise ModbusException(
                ExceptionCode.ILLEGAL_DATA_ADDRESS, f"{address} and {len(values) - 1} more: read only"
            )
        now, written = list(self.image()[: len(WRITABLE)]), range(address, address + len(values))
        now[address : address + len(values)] = values
        self.write(tuple(now), written)

    def write_bits(self, address: int, values: Sequence[bool]) -> None:
        self._require_writer()
        _require_inside(address, len(values), BITS)
        word = self.image()[CONTROL]
        for bit, value in enumerate(values, start=address):
            word = word | 1 << bit if value else word & ~(1 << bit)
        self.write_words(CONTROL, [word])

    def _require_writer(self) -> None:
        if not self.may_write:
            raise ModbusException(ExceptionCode.ILLEGAL_FUNCTION, "this client may read only: see [plc] writers")


def _require_inside(address: int, count: int, size: int) -> None:
    if address + count > size:
        raise ModbusException(ExceptionCode.ILLEGAL_DATA_ADDRESS, f"{address} and {count - 1} more: there are {size}")
