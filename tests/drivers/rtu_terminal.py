"""A Modbus RTU terminal at the end of a serial line: a gate at input 0, a part at input 1; it may answer late."""

import asyncio
from collections import deque
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field

from drivers.interlocks import InterlockSignal
from drivers.transports.serial_line import SerialConnection, SerialTransport
from protocols.modbus.bank import Identification, respond
from protocols.modbus.client_framing import RtuFraming
from tests.drivers.modbus_terminal import Terminal
from tests.support.serial_pair import cable

GATE = InterlockSignal("gate closed", "discrete-input", 0)
PART = InterlockSignal("part present", "discrete-input", 1)
UNIT = 1
REQUEST_BYTES = 8


@dataclass
class RtuTerminal:
    """`held`: answers that were made and are not yet sent, while `holds`. Answers keep their order."""

    connection: SerialConnection
    port: str
    bank: Terminal = field(default_factory=Terminal)
    holds: bool = False
    held: deque[bytes] = field(default_factory=deque)
    asked: int = 0

    @property
    def address(self) -> str:
        return f"serial://{self.port}?baud=115200&parity=N"

    async def serve(self) -> None:
        """Until cancelled."""
        data, framing = b"", RtuFraming(UNIT)
        while True:
            data += await self.connection.receive()
            while len(data) >= REQUEST_BYTES:
                request, data = data[:REQUEST_BYTES], data[REQUEST_BYTES:]
                assert request == framing.encode(request[1:-2])
                self.held.append(framing.encode(respond(request[1:-2], self.bank, Identification("t", "t", "0"))))
                self.asked += 1
                if not self.holds:
                    await self.send(len(self.held))

    async def send(self, count: int) -> None:
        """The oldest answers that are held."""
        for _ in range(min(count, len(self.held))):
            await self.connection.send(self.held.popleft())


@asynccontextmanager
async def rtu_terminal(inputs: int = 64) -> AsyncIterator[RtuTerminal]:
    async with cable() as (ours, theirs):
        connection = await SerialTransport(theirs, 115200).connect()
        device = RtuTerminal(connection, ours, Terminal(inputs=[True] + [False] * (inputs - 1)))
        serving = asyncio.create_task(device.serve())
        try:
            yield device
        finally:
            serving.cancel()
            await asyncio.gather(serving, return_exceptions=True)
            await connection.close()
