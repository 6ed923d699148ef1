"""A line on which answers are late, lost, doubled and swapped, and a Modbus device at its end that counts.

The device's bits are a counter that moves on with everything it is asked and by itself: a value shows when it was had.
"""

import struct
from collections import deque
from dataclasses import dataclass, field, replace

from hypothesis import strategies as st

from protocols.modbus.bit_reader import ReadBits
from protocols.modbus.codes import ERROR_BIT, ExceptionCode, Function

COUNTER_BITS = 16

# what happens to a message before anything else does
CARRY, LOSE, DOUBLE, SWAP, TICK, BUSY, GIVE_UP = "carry", "lose", "double", "swap", "tick", "busy", "give up"
IN_ANY_ORDER = st.sampled_from([CARRY, CARRY, CARRY, LOSE, DOUBLE, TICK, BUSY, GIVE_UP, SWAP, SWAP])
SERVER_DEVICE_BUSY = 6


@dataclass
class CountingDevice:
    """`size` bits from address 0, the first 16 the counter. What it does not have it refuses, or does not answer."""

    functions: frozenset[Function]
    size: int = COUNTER_BITS
    refuses: bool = True
    counter: int = 0
    busy: bool = False

    def answer(self, pdu: bytes) -> bytes | None:
        """The PDU that it sends; None: it does not."""
        self.counter += 1
        function, address, count = struct.unpack(">BHH", pdu)
        question = ReadBits(Function(function), address, count)
        code: int | None = None
        if self.busy:
            code, self.busy = SERVER_DEVICE_BUSY, False
        elif question.function not in self.functions:
            code = ExceptionCode.ILLEGAL_FUNCTION
        elif question.address + question.count > self.size:
            code = ExceptionCode.ILLEGAL_DATA_ADDRESS
        if code is not None:
            return bytes([question.function | ERROR_BIT, code]) if self.refuses or code == SERVER_DEVICE_BUSY else None
        size = (question.count + 7) // 8
        value = (self.counter % (1 << COUNTER_BITS)) >> question.address
        value &= (1 << question.count) - 1
        return bytes([question.function, size]) + value.to_bytes(size, "little")


@dataclass
class Line:
    """Messages one way, in the order they were sent unless something happens to them."""

    waiting: deque[bytes] = field(default_factory=deque)

    def trouble(self, what: str) -> None:
        """Lose, double or swap what comes next."""
        if what == LOSE and self.waiting:
            self.waiting.popleft()
        elif what == DOUBLE and self.waiting:
            self.waiting.appendleft(self.waiting[0])
        elif what == SWAP and len(self.waiting) > 1:
            self.waiting.rotate(1)


COILS, INPUTS = Function.READ_COILS, Function.READ_DISCRETE_INPUTS
DEVICES = {
    "many inputs": CountingDevice(frozenset({INPUTS}), size=64),
    "inputs and coils": CountingDevice(frozenset({INPUTS, COILS}), size=64),
    "no bit more than wanted": CountingDevice(frozenset({INPUTS})),
    "no bit more, and coils": CountingDevice(frozenset({INPUTS, COILS})),
    "8 bits more": CountingDevice(frozenset({INPUTS}), size=24),
    "no answer to what it has not": CountingDevice(frozenset({INPUTS, COILS}), refuses=False),
}


def device_of(name: str) -> CountingDevice:
    """A new one, which has counted nothing."""
    return replace(DEVICES[name])
