"""One connection: requests and answers, heartbeats, and its end. It does not survive a reconnect."""

import asyncio
from collections import Counter, OrderedDict
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field

from drivers.errors import DeviceError, GarbledAnswer, LinkLost
from drivers.timing import Timing
from drivers.transports.transport import Connection
from protocols.cb.client import ClientEvent, ClientSession, GarbledReply, GreetingLost, ReplyReceived
from protocols.cb.codes import VERSION, Status
from protocols.cb.errors import NotAllowedNow
from protocols.cb.frames import FramingBroken, GarbageSkipped
from protocols.cb.messages import Hello, Ping, Refused, Reply, Request, Stop, Welcome

Turns = OrderedDict[asyncio.Future[None], None]


class PriorityLock:
    """An asyncio lock whose urgent waiters go first; a waiter that is cancelled leaves the queue."""

    def __init__(self) -> None:
        self._taken = False
        self._urgent: Turns = OrderedDict()
        self._ordinary: Turns = OrderedDict()

    @asynccontextmanager
    async def hold(self, *, urgent: bool = False) -> AsyncIterator[None]:
        await self._enter(self._urgent if urgent else self._ordinary)
        try:
            yield
        finally:
            self._leave()

    async def _enter(self, queue: Turns) -> None:
        if not self._taken:
            self._taken = True
            return
        turn: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        queue[turn] = None
        try:
            await turn
        except asyncio.CancelledError:
            queue.pop(turn, None)
            if turn.done() and not turn.cancelled():
                self._leave()  # the lock was granted at the moment of cancellation: pass it on
            raise

    def _leave(self) -> None:
        for queue in (self._urgent, self._ordinary):
            while queue:
                turn, _ = queue.popitem(last=False)
                if not turn.done():
                    turn.set_result(None)
                    return
        self._taken = False


REPLY_LIMIT_S = 2.0
REPEAT_AFTER_S, MAX_REPEAT_S = 0.25, 1.0
"""A full frame takes 83 ms at 9600 baud; an answer that takes three times as long was lost. To avoid flooding a slow
controller, each repetition waits twice as long as the one before, and the next request starts with half of what the
last one needed.
"""
HEARTBEAT_S = 0.5
CLIENT_ID = 1

REFUSED_GREETINGS: dict[int, tuple[str, str]] = {
    Status.BUSY: ("another client is connected", "close the other client; the controller serves one"),
    Status.VERSION: (f"the controller does not speak version {VERSION}", "load the program modules of this release"),
}


class OvertakenByStop(Exception):
    """A STOP overtook the request, which was abandoned. Readings are sent again, a move is not."""


ExchangeResult = ReplyReceived | DeviceError | OvertakenByStop


@dataclass(frozen=True)
class Answered:
    """A reply, its request's number, when the request was first sent (the reply is not older), and how long it took."""

    reply: Reply
    seq: int
    asked_at_s: float
    seconds: float


@dataclass
class WireCounts:
    """What passed in a conversation. `strange`: events other than answers, by kind."""

    answers: int = 0
    repeats: int = 0
    pieces: int = 0
    strange: Counter[str] = field(default_factory=Counter)


@dataclass(frozen=True)
class CbLimits:
    """How long an answer may take, and how long the rest of a frame that began.

    `silence_ends`: a request without an answer ends the connection; otherwise it fails alone.
    """

    reply_s: float
    half_frame_s: float
    silence_ends: bool = True


class CbConversation:
    """Exchanges over one connection. After `lose`, every request raises the error."""

    def __init__(
        self,
        device: str,
        connection: Connection,
        session: ClientSession,
        timing: Timing,
        limits: CbLimits,
        on_lost: Callable[[DeviceError], None],
    ) -> None:
        self._device, self._connection, self.session, self._timing = device, connection, session, timing
        self._limits, self._on_lost = limits, on_lost
        self._turnstile = PriorityLock()
        self._outcome: asyncio.Future[ExchangeResult] | None = None
        self._stopping = False
        self._answered_at_s = timing.clock()
        self._garbage_bytes = 0
        self._patience_s = REPEAT_AFTER_S
        self.counts = WireCounts()
        self.lost: asyncio.Future[DeviceError] = asyncio.get_running_loop().create_future()

    async def greet(self) -> Welcome:
        """Send HELLO; raises GarbledAnswer, or LinkLost, also when the controller refuses the client."""
        reply = (await self.ask(Hello(VERSION, VERSION, CLIENT_ID))).reply
        if isinstance(reply, Refused):
            unknown = (f"the controller refused the greeting with {reply.name}", "look at its event log")
            what, fix = REFUSED_GREETINGS.get(reply.status, unknown)
            raise LinkLost(self._device, what, fix)
        assert isinstance(reply, Welcome)
        return reply

    async def ask(self, request: Request, *, urgent: bool = False) -> Answered:
        """Send a request and return the answer. `urgent`: before all requests that are not.

        Raises LinkLost or GarbledAnswer, and OvertakenByStop for all but a STOP.
        """
        return (await self.ask_in_turn(request, urgent=urgent))[0]

    async def ask_in_turn(self, *requests: Request, urgent: bool = False) -> list[Answered]:
        """Send requests one after the other with no other between them; errors as in `ask`.

        When the first is a STOP, they are urgent, and the exchange in progress is abandoned at once.
        """
        stops = isinstance(requests[0], Stop)
        if stops and not self._stopping:
            self._settle(OvertakenByStop())
        async with self._turnstile.hold(urgent=urgent or stops):
            if self.lost.done():
                raise _again(self.lost.result())
            self._stopping = stops
            try:
                return [await self._exchange(request) for request in requests]
            finally:
                self._stopping = False
                self._outcome = None
                self.session.abandon()

    async def _exchange(self, request: Request) -> Answered:
        outcome: asyncio.Future[ExchangeResult] = asyncio.get_running_loop().create_future()
        self._outcome = outcome
        asked_at_s = self._timing.clock()
        try:
            encoded = self.session.request(request)
        except NotAllowedNow as error:
            raise LinkLost(self._device, "the link is being closed", "open it again to go on") from error
        patience_s, repeated = self._patience_s, False
        while not outcome.done():
            remaining_s = asked_at_s + self._limits.reply_s - self._timing.clock()
            if remaining_s <= 0:
                if not self._limits.silence_ends:
                    raise self._silence()
                self.lose(self._silence())
                break
            await self._send(encoded)
            self.counts.repeats += repeated
            if not await self._timing.wait_until_done(outcome, min(patience_s, remaining_s)):
                patience_s, repeated = min(2.0 * patience_s, MAX_REPEAT_S), True
        self._patience_s = max(patience_s / 2.0, REPEAT_AFTER_S)
        ended = outcome.result()
        if not isinstance(ended, ReplyReceived):
            raise ended
        return Answered(ended.reply, ended.seq, asked_at_s, self._timing.clock() - asked_at_s)

    async def listen(self) -> None:
        """Process received bytes until the connection ends."""
        receiving: asyncio.Future[bytes] | None = None
        try:
            while not self.lost.done():
                receiving = receiving or asyncio.ensure_future(self._connection.receive())
                if self.session.half_frame_bytes and not await self._timing.wait_until_done(
                    receiving, self._limits.half_frame_s
                ):
                    self._take(self.session.abandon_half_frame())
                    continue
                data, receiving = await receiving, None
                self.counts.pieces += 1
                self._take(self.session.receive_data(data))
        except DeviceError as error:
            self.lose(error)
        finally:
            if receiving is not None:
                receiving.cancel()

    async def keep_alive(self) -> None:
        """Send PING whenever nothing was answered for one heartbeat."""
        while not self.lost.done():
            quiet_s = self._timing.clock() - self._answered_at_s
            if quiet_s < HEARTBEAT_S:
                await self._timing.sleep(HEARTBEAT_S - quiet_s)
                continue
            try:
                await self.ask(Ping())
            except OvertakenByStop:
                continue
            except GarbledAnswer as error:
                self.lose(error)
            except DeviceError:
                return

    def lose(self, error: DeviceError) -> None:
        """End the conversation; all pending requests raise the error."""
        if not self.lost.done():
            self.lost.set_result(error)
            self._on_lost(error)
        self._settle(_again(error))

    async def _send(self, encoded: bytes) -> None:
        try:
            await self._connection.send(encoded)
        except LinkLost as error:
            self.lose(error)

    def _take(self, events: list[ClientEvent]) -> None:
        for event in events:
            if isinstance(event, ReplyReceived):
                self.counts.answers += 1
            else:
                self.counts.strange[type(event).__name__] += 1
            match event:
                case ReplyReceived():
                    self._answered_at_s, self._garbage_bytes = self._timing.clock(), 0
                    self._settle(event)
                case GarbledReply(seq=seq, reason=reason) if seq == self.session.outstanding_seq:
                    fix = "the controller's program and this release do not belong together"
                    self._settle(GarbledAnswer(self._device, f"an answer that is none: {reason}", fix))
                case FramingBroken(reason=reason):
                    greeted = self.session.session is not None
                    fix = (
                        "check the cable and its shield"
                        if greeted
                        else "check that the address is the communication task's"
                    )
                    self.lose(GarbledAnswer(self._device, f"what came is not the CB link: {reason}", fix))
                case GreetingLost():
                    fix = "nothing of before runs on; arm again"
                    self.lose(LinkLost(self._device, "the controller restarted and knows no greeting", fix))
                case GarbageSkipped(count=count):
                    self._garbage_bytes += count
                case _:
                    pass  # bad checksum, late or unsolicited answer: the request is repeated after its timeout

    def _settle(self, outcome: ExchangeResult) -> None:
        if self._outcome is not None and not self._outcome.done():
            self._outcome.set_result(outcome)

    def _silence(self) -> LinkLost:
        dirt = f", but {self._garbage_bytes} bytes that are no frames" if self._garbage_bytes else ""
        fix = "check the cable and the line's settings, and that the communication task runs"
        return LinkLost(self._device, f"no reply for {self._limits.reply_s:g} s{dirt}", fix)


def _again(error: DeviceError) -> DeviceError:
    """A new exception of the same kind: one raised in several places would accumulate their tracebacks."""
    return type(error)(error.device, error.what, error.fix)
