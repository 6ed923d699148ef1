"""Numbers in the registers of a PLC, as a PLC reads them."""

import struct
from collections.abc import Sequence

from protocols.modbus.words import WordOrder, unsigned_of


def float_of(words: Sequence[int], order: WordOrder) -> float:
    """A float32 of two registers."""
    return float(struct.unpack(">f", unsigned_of(words, order).to_bytes(4, "big"))[0])


def integer_of(words: Sequence[int], order: WordOrder) -> int:
    """An int32 of two registers."""
    return int.from_bytes(unsigned_of(words, order).to_bytes(4, "big"), "big", signed=True)
