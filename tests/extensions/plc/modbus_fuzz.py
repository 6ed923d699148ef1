"""Fuzzed Modbus TCP frames against the PLC's server, over real sockets.

Each connection sends a burst of frames in pieces of random length: good requests, requests with any bytes in a good
envelope, and at the end sometimes something that is no frame at all. Lost is every frame of a good envelope without
its answer, in order, under its own transaction; a bad frame must be answered by closing, within a second.
"""

import asyncio
import contextlib
import logging
import random
import socket
import struct
import time
from collections.abc import AsyncIterator
from dataclasses import dataclass, field

from extensions.plc.tcp import ModbusTcp, ModbusTcpLimits, Respond
from protocols.modbus.bank import Identification, respond
from protocols.modbus.mbap import Adu, MbapReader
from protocols.modbus.words import Words
from protocols.plc.bank import PlcBank
from protocols.plc.events import CellStatus, RegistersWritten
from protocols.plc.handshake import Handshake, Rules, react, register_image
from protocols.plc.registers import SIZE
from tests.support.waiting import LIMIT_S

CLOSED_WITHIN_S = 1.0

IDENTIFICATION = Identification("handeyed", "benchmark", "0")


class Registers:
    """The handshake without a daemon behind it."""

    def __init__(self) -> None:
        self.state = react(Handshake(Rules(motion_allowed=False)), CellStatus(ready=True)).state
        self.image = register_image(self.state)

    def write(self, words: Words, _: range) -> None:
        self.state = react(self.state, RegistersWritten(words)).state
        self.image = register_image(self.state)

    def respond_to(self, _client: str) -> Respond:
        bank = PlcBank(lambda: self.image, self.write, may_write=True)
        return lambda pdu, _repeated: respond(pdu, bank, IDENTIFICATION)


@dataclass
class Tally:
    """What came of it."""

    frames: int = 0
    answered: int = 0
    lost: int = 0
    bad: int = 0
    closed_late: int = 0
    kept_open: int = 0
    slowest_close_s: float = 0.0
    seconds: float = 0.0
    errors: list[str] = field(default_factory=list)

    @property
    def clean(self) -> bool:
        return not (self.lost or self.kept_open or self.errors)

    def table(self) -> str:
        return "\n".join(
            [
                f"{'frames in a good envelope':<34}{self.frames:>12,}",
                f"{'answered, in order':<34}{self.answered:>12,}",
                f"{'lost':<34}{self.lost:>12,}",
                f"{'bad frames':<34}{self.bad:>12,}",
                f"{'closed later than 1 s, or never':<34}{self.closed_late + self.kept_open:>12,}",
                f"{'slowest close':<34}{self.slowest_close_s:>10.3f} s",
                f"{'errors in the server':<34}{len(self.errors):>12,}",
                f"{'frames a second, both ends':<34}{self.frames / max(self.seconds, 1e-9):>12,.0f}",
            ]
        )


@contextlib.asynccontextmanager
async def served(limits: ModbusTcpLimits) -> AsyncIterator[ModbusTcp]:
    """The front end, listening on any port."""
    server = ModbusTcp(socket.create_server(("127.0.0.1", 0)), Registers().respond_to, limits)
    await server.start()
    try:
        yield server
    finally:
        await server.stop()


async def fuzz(frames: int, seed: int) -> Tally:
    """So many frames of a good envelope, and bad ones between them."""
    chance, tally = random.Random(seed), Tally()
    loop = asyncio.get_running_loop()
    loop.set_exception_handler(lambda _loop, context: tally.errors.append(str(context)))
    log = logging.getLogger("extensions.plc.tcp")
    level, began_s = log.level, time.perf_counter()
    log.setLevel(logging.ERROR)
    try:
        async with served(ModbusTcpLimits(8, 5.0, half_frame_s=0.2)) as server:
            while tally.frames < frames:
                await _connection(server.port, chance, min(200, frames - tally.frames), tally)
    finally:
        log.setLevel(level)  # the process's, and what others log is read in tests
    tally.seconds = time.perf_counter() - began_s
    return tally


async def _connection(port: int, chance: random.Random, frames: int, tally: Tally) -> None:
    adus = [Adu(chance.randrange(65536), chance.randrange(256), _pdu(chance)) for _ in range(frames)]
    bad = _bad(chance)
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    sending = asyncio.create_task(_send(writer, _pieces(chance, b"".join(adu.encode() for adu in adus) + bad)))
    answers = MbapReader()
    found: list[Adu] = []
    with contextlib.suppress(TimeoutError, ConnectionError):
        async with asyncio.timeout(LIMIT_S):
            while len(found) < len(adus) and (data := await reader.read(65536)):
                found += answers.feed(data)
    good = sum(_answers(answer, adu) for answer, adu in zip(found, adus, strict=False))
    tally.frames += len(adus)
    tally.answered += good
    tally.lost += len(adus) - good
    with contextlib.suppress(ConnectionError):
        await sending
    if bad:
        tally.bad += 1
        await _must_close(reader, tally)
    writer.close()
    with contextlib.suppress(ConnectionError):
        await writer.wait_closed()


async def _must_close(reader: asyncio.StreamReader, tally: Tally) -> None:
    began_s = time.perf_counter()
    try:
        async with asyncio.timeout(LIMIT_S):
            while await reader.read(65536):
                pass
    except TimeoutError:
        tally.kept_open += 1
        return
    except ConnectionError:
        pass
    took_s = time.perf_counter() - began_s
    tally.slowest_close_s = max(tally.slowest_close_s, took_s)
    tally.closed_late += took_s > CLOSED_WITHIN_S


async def _send(writer: asyncio.StreamWriter, pieces: list[bytes]) -> None:
    for piece in pieces:
        writer.write(piece)
        await writer.drain()


def _pieces(chance: random.Random, stream: bytes) -> list[bytes]:
    """Cut anywhere, some pieces of one byte."""
    cuts = sorted({chance.randrange(len(stream)) for _ in range(chance.choice((0, 1, 5, 40)))} - {0})
    return [stream[a:b] for a, b in zip([0, *cuts], [*cuts, len(stream)], strict=True)]


def _answers(answer: Adu, adu: Adu) -> bool:
    """Its own transaction, unit and function, and an answer that can be one."""
    same = (answer.transaction, answer.unit) == (adu.transaction, adu.unit)
    return same and answer.pdu[0] & 0x7F == adu.pdu[0] & 0x7F and len(answer.pdu) >= 2


def _pdu(chance: random.Random) -> bytes:
    """Mostly something sensible, sometimes anything."""
    kind = chance.randrange(10)
    address, count = chance.randrange(SIZE), chance.randrange(1, 30)
    if kind < 5:
        return struct.pack(">BHH", chance.choice((3, 4)), address, count)
    if kind == 5:
        return struct.pack(">BHH", chance.choice((1, 2)), chance.randrange(16), 1)
    if kind == 6:
        return struct.pack(">BHHBH", 16, 1, 1, 2, chance.randrange(65536))
    if kind == 7:
        return struct.pack(">BHH", 5, chance.randrange(16), chance.choice((0, 0xFF00)))
    if kind == 8:
        whole = bytearray(struct.pack(">BHHHHBH", 23, address, count, 1, 1, 2, 7))
        whole[chance.randrange(len(whole))] = chance.randrange(256)
        return bytes(whole)
    return chance.randbytes(chance.randrange(1, 254))


def _bad(chance: random.Random) -> bytes:
    """Often nothing; else a header that cannot be one, or a frame that stops."""
    kind = chance.randrange(8)
    if kind == 0:
        return struct.pack(">HHHB", 1, chance.randrange(1, 65536), 6, 1) + chance.randbytes(40)
    if kind == 1:
        return struct.pack(">HHHB", 1, 0, chance.choice((0, 1, 255, 256, 65535)), 1) + chance.randbytes(300)
    if kind == 2 and chance.randrange(8) == 0:  # these are waited for
        return struct.pack(">HHHB", 1, 0, 6, 1)[: chance.randrange(1, 7)]
    if kind == 3:
        return b"GET / HTTP/1.1\r\nHost: cell\r\n\r\n"
    return b""
