"""A plain client of the CB link that counts all it sees: durations, repetitions, pieces, frames nobody asked for."""

import asyncio
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass

from drivers.errors import DeviceError, GarbledAnswer, LinkLost
from drivers.timing import Timing
from drivers.transports.transport import Connection, Transport
from protocols.cb.client import ClientSession, GarbledReply, RepeatWanted, ReplyReceived
from protocols.cb.codes import VERSION
from protocols.cb.errors import NotAllowedNow
from protocols.cb.frames import FramingBroken
from protocols.cb.messages import Bye, Hello, Refused, Reply, Request, Welcome

REPLY_LIMIT_S, REPEAT_AFTER_S = 2.0, 0.25
CLIENT_ID = 2


@dataclass
class WireCounts:
    """What passed since the connection was opened. `strange`: events other than answers, by kind."""

    answers: int
    repeats: int
    pieces: int
    strange: Counter[str]


@dataclass(frozen=True)
class Exchange:
    """One answer, its request's number, the time from the first sending to it, and when that was."""

    reply: Reply
    seq: int
    seconds: float
    asked_at_s: float


class Wire:
    """One connection, greeted by `open`. It sends nothing by itself: no heartbeat."""

    def __init__(self, transport: Transport, timing: Timing) -> None:
        self._transport, self._timing = transport, timing
        self._connection: Connection | None = None
        self._receiving: asyncio.Task[bytes] | None = None
        self.counts = WireCounts(0, 0, 0, Counter())
        self.welcome: Welcome | None = None

    @property
    def device(self) -> str:
        return f"robot {self._transport.address}"

    @property
    def last_seq(self) -> int:
        """Number of the newest request."""
        return self._session.last_seq

    async def open(self) -> "Wire":
        """Connect and greet. Raises DeviceError; LinkLost names the status of a refused greeting."""
        self._connection = await self._transport.connect()
        self._session = ClientSession(resynchronise=self._transport.resynchronise)
        reply = (await self.ask(Hello(VERSION, VERSION, CLIENT_ID))).reply
        if isinstance(reply, Refused):
            raise LinkLost(self.device, f"the greeting was refused: {reply.name}", "close every other client")
        assert isinstance(reply, Welcome)
        self.welcome = reply
        return self

    async def ask(self, request: Request) -> Exchange:
        """Send a request, again after REPEAT_AFTER_S, and return its answer. Raises LinkLost, GarbledAnswer."""
        connection, clock = self._connection, self._timing.clock
        assert connection is not None
        self._session.abandon()
        encoded, asked_at_s = self._session.request(request), clock()
        seq, due_s = self._session.last_seq, asked_at_s
        while clock() - asked_at_s < REPLY_LIMIT_S:
            if clock() >= due_s:
                self.counts.repeats += int(due_s > asked_at_s)
                due_s = clock() + REPEAT_AFTER_S
                await connection.send(encoded)
            data = await self._receive(connection, max(0.0, due_s - clock()))
            if data is None:
                continue
            answered = self._take(data, encoded)
            if answered is not None:
                return Exchange(answered.reply, seq, clock() - asked_at_s, asked_at_s)
        raise LinkLost(self.device, f"no reply for {REPLY_LIMIT_S:g} s", "look whether the communication task runs")

    async def close(self, *, politely: bool = True) -> None:
        """Close, after BYE and its answer when `politely`; otherwise as a PC that is switched off."""
        connection = self._connection
        if connection is None:
            return
        if politely:
            with suppress(DeviceError, NotAllowedNow):
                await self.ask(Bye())
        self._connection = None
        if self._receiving is not None:
            self._receiving.cancel()
            await asyncio.gather(self._receiving, return_exceptions=True)
            self._receiving = None
        await connection.close()

    async def _receive(self, connection: Connection, limit_s: float) -> bytes | None:
        self._receiving = self._receiving or asyncio.ensure_future(connection.receive())
        if not await self._timing.wait_until_done(self._receiving, limit_s):
            return None
        receiving, self._receiving = self._receiving, None
        self.counts.pieces += 1
        return receiving.result()

    def _take(self, data: bytes, encoded: bytes) -> ReplyReceived | None:
        answered = None
        for event in self._session.receive_data(data):
            match event:
                case ReplyReceived():
                    answered = event
                    self.counts.answers += 1
                case GarbledReply(reason=reason) | FramingBroken(reason=reason):
                    raise GarbledAnswer(self.device, reason, "look at the program and the line")
                case RepeatWanted():
                    self.counts.repeats += 1
                    self.counts.strange["RepeatWanted"] += 1
                case _:
                    self.counts.strange[type(event).__name__] += 1
        return answered
