"""A client of the CB link over a real socket or a pty, as thin as can be."""

import asyncio
import os
import tty
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass

from protocols.cb import messages as cb
from protocols.cb.client import ClientEvent, ClientSession, ReplyReceived
from protocols.cb.codes import Status
from tests.support.waiting import LIMIT_S


@dataclass
class CbClient:
    """Ask and be answered."""

    session: ClientSession
    write: Callable[[bytes], None]
    read: Callable[[], Awaitable[bytes]]

    async def asks(self, request: cb.Request) -> cb.Reply:
        """The reply; raises ConnectionError when the controller hung up."""
        self.write(self.session.request(request))
        return await self.is_answered()

    async def is_answered(self) -> cb.Reply:
        async with asyncio.timeout(LIMIT_S):
            while True:
                for event in await self.hears():
                    if isinstance(event, ReplyReceived):
                        return event.reply

    async def hears(self) -> list[ClientEvent]:
        data = await self.read()
        if not data:
            raise ConnectionResetError("the controller hung up")
        return self.session.receive_data(data)

    async def is_armed(self) -> "CbClient":
        welcome = await self.asks(cb.Hello(1, 1, 9))
        assert isinstance(welcome, cb.Welcome), welcome
        answer = await self.asks(cb.SetArmed(welcome.session, True))
        assert answer == cb.ArmingDone(), answer
        return self

    async def moves(self, request: cb.Move) -> Status:
        """Move and ask for STATUS until it has ended."""
        reply = await self.asks(request)
        if isinstance(reply, cb.Refused):
            return Status(reply.status)
        seq = self.session.last_seq
        async with asyncio.timeout(LIMIT_S):
            while True:
                report = await self.asks(cb.GetStatus())
                assert isinstance(report, cb.Report)
                if report.finished_seq == seq:
                    return Status(report.finished_status)
                await asyncio.sleep(0.01)


@asynccontextmanager
async def over_tcp(port: int, host: str = "127.0.0.1") -> AsyncIterator[CbClient]:
    reader, writer = await asyncio.open_connection(host, port)
    try:
        yield CbClient(ClientSession(resynchronise=False), writer.write, lambda: reader.read(4096))
    finally:
        writer.close()


@asynccontextmanager
async def over_serial(path: str) -> AsyncIterator[CbClient]:
    line = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    tty.setraw(line)
    loop = asyncio.get_running_loop()
    arrived: asyncio.Queue[bytes] = asyncio.Queue()
    loop.add_reader(line, lambda: arrived.put_nowait(os.read(line, 4096)))
    try:
        yield CbClient(ClientSession(resynchronise=True), lambda data: _write(line, data), arrived.get)
    finally:
        loop.remove_reader(line)
        os.close(line)


def _write(line: int, data: bytes) -> None:
    assert os.write(line, data) == len(data)
