"""A Modbus I/O terminal that interlocks read."""

import asyncio
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, field

from protocols.modbus.bank import Identification, respond
from protocols.modbus.codes import ExceptionCode, Function
from protocols.modbus.errors import ModbusException
from protocols.modbus.mbap import Adu, MbapReader


@dataclass
class Terminal:
    """A Modbus terminal of the cell: eight inputs, eight coils; it can be made to say nothing."""

    inputs: list[bool] = field(default_factory=lambda: [True] + [False] * 7)
    coils: list[bool] = field(default_factory=lambda: [False] * 3 + [True] + [False] * 4)
    mute: bool = False
    port: int = 0
    asked: int = 0
    writers: set[asyncio.StreamWriter] = field(default_factory=set)

    def words(self, function: Function, address: int, count: int) -> Sequence[int]:
        raise ModbusException(ExceptionCode.ILLEGAL_FUNCTION, "bits only")

    def bits(self, function: Function, address: int, count: int) -> Sequence[bool]:
        if address + count > len(self.inputs):
            raise ModbusException(ExceptionCode.ILLEGAL_DATA_ADDRESS, f"{len(self.inputs)}")
        self.asked += 1
        return (self.coils if function is Function.READ_COILS else self.inputs)[address : address + count]

    def write_words(self, address: int, values: Sequence[int]) -> None:
        raise AssertionError("an interlock is never written")

    def write_bits(self, address: int, values: Sequence[bool]) -> None:
        raise AssertionError("an interlock is never written")

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.writers.add(writer)
        frames = MbapReader()
        while data := await reader.read(4096):
            for adu in frames.feed(data):
                if not self.mute:
                    pdu = respond(adu.pdu, self, Identification("t", "t", "0"))
                    writer.write(Adu(adu.transaction, adu.unit, pdu).encode())
        writer.close()


@asynccontextmanager
async def terminal(port: int = 0) -> AsyncIterator[Terminal]:
    device = Terminal()
    server = await asyncio.start_server(device.serve, "127.0.0.1", port)
    device.port = server.sockets[0].getsockname()[1]
    try:
        yield device
    finally:
        server.close()
        for writer in device.writers:
            writer.close()
        await asyncio.gather(*(writer.wait_closed() for writer in device.writers), return_exceptions=True)
        await server.wait_closed()
