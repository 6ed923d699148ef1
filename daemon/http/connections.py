"""What a connection may do before and between requests: how long, how much, how many.

uvicorn keeps a connection open whose head never ends, and answers what it cannot parse in plain text. Here the head of
a request has a limit in time and in bytes, a body or an answer that no longer moves is cut off, and when there are too
many connections the one that has kept us waiting longest makes room.
"""

import asyncio
import resource
from dataclasses import dataclass, field
from typing import Any

from uvicorn.protocols.http.flow_control import HIGH_WATER_LIMIT
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from daemon.http.problem_details import MEDIA_TYPE, Problem
from daemon.http.receive_buffer import Inlet, Room
from daemon.http.tls_handshake import Handshake

MALFORMED = (400, "request-malformed", "this is not an HTTP/1.1 request", "send one; for TLS use https://")
TOO_SLOW = (408, "request-too-slow", "the request's head did not come in time", "send it in one go")
TOO_LONG = (431, "head-too-large", "the request's head is too large", "send fewer or shorter headers")
TOO_MANY = (503, "too-many-connections", "too many connections are open", "close some, and ask again")

Refusal = tuple[int, str, str, str]

SPARE_DESCRIPTORS = 256
"""For files, devices and the store."""


@dataclass(frozen=True)
class Limits:
    """Of one connection. `idle_s`: for a body that stops coming, and an answer that nobody takes.

    `linger_s`: how long what still comes is thrown away after the last answer. Closed at once, the system would answer
    it with a reset, and the client might never read why it was refused.
    """

    head_s: float = 10.0
    head_bytes: int = 65_536
    idle_s: float = 60.0
    linger_s: float = 2.0
    connections: int = 4000


@dataclass(eq=False)
class Door:
    """What all connections of one server share: the limits, and who keeps it waiting, the longest first."""

    limits: Limits = field(default_factory=lambda: Limits(connections=_affordable(Limits.connections)))
    waiting: "dict[GuardedConnection | Handshake, None]" = field(default_factory=dict)
    handshakes: set[Handshake] = field(default_factory=set)
    room: Room = field(default_factory=Room)
    _established: set[Any] = field(default_factory=set)

    def protocol(self, handshake: Handshake | None = None, **arguments: Any) -> Inlet:
        """For `uvicorn.Config(http=...)`. `handshake`: the connection's own, which is done."""
        self._established = arguments["server_state"].connections
        return Inlet(GuardedConnection(self, handshake, **arguments), self.room)

    def has_room(self) -> bool:
        """For one more; the connection that has waited longest is closed for it. False when every one is at work."""
        if len(self._established) + len(self.handshakes) < self.limits.connections:
            return True
        for oldest in self.waiting:
            oldest.abort()
            del self.waiting[oldest]
            return True
        return False

    def enter(self, newcomer: Handshake) -> bool:
        """A handshake begins, if there is room for it."""
        if not self.has_room():
            return False
        self.handshakes.add(newcomer)
        self.waiting[newcomer] = None
        return True

    def leave(self, one: Handshake) -> None:
        """It is done, or gone."""
        self.handshakes.discard(one)
        self.waiting.pop(one, None)

    def close(self) -> None:
        """Nobody comes in any more."""
        for handshake in self.handshakes:
            handshake.abort()


def _affordable(wanted: int) -> int:
    """Descriptors for so many connections, or as many as the system gives."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    needed = wanted + SPARE_DESCRIPTORS
    if soft < needed:
        soft = needed if hard == resource.RLIM_INFINITY else min(needed, hard)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    return max(16, min(wanted, soft - SPARE_DESCRIPTORS))


class GuardedConnection(HttpToolsProtocol):
    """uvicorn's connection, with limits."""

    def __init__(self, door: Door, handshake: Handshake | None, **arguments: Any) -> None:
        super().__init__(**arguments)
        self._handshake = handshake
        self._door, self._limits = door, door.limits
        self._head_since_s: float | None = None
        self._head_bytes = 0
        self._moved_s = 0.0
        self._unsent = 0
        self._deaf = False
        self._check: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        if self._handshake is not None:
            self._door.leave(self._handshake)
        welcome = self._door.has_room()
        super().connection_made(transport)
        self._moved_s = self.loop.time()
        if not welcome:
            self._refuse(TOO_MANY)
            return
        self._wait_for_a_head()
        self._look_again()

    def abort(self) -> None:
        """It has to go."""
        self.transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        if self._check is not None:
            self._check.cancel()
        self._door.waiting.pop(self, None)
        super().connection_lost(exc)

    def data_received(self, data: bytes | memoryview) -> None:
        if self._deaf or self.transport.is_closing():
            return
        self._moved_s = self.loop.time()
        if self._head_since_s is None and not self._in_progress:
            self._wait_for_a_head()
        super().data_received(data)  # type: ignore[arg-type] # httptools reads any buffer, and keeps copies
        if self._head_since_s is not None:
            self._head_bytes += len(data)
            if self._head_bytes > self._limits.head_bytes:
                self._refuse(TOO_LONG)

    def on_body(self, body: bytes) -> None:
        """As uvicorn's, but a piece that nobody waits behind is handed on as it came: two copies fewer for a cloud."""
        if self.cycle.body or self.cycle.response_complete or self.parser.should_upgrade():
            super().on_body(body)
            return
        self.cycle.body = body  # type: ignore[assignment]
        if len(body) > HIGH_WATER_LIMIT:
            self.flow.pause_reading()
        self.cycle.message_event.set()

    def on_headers_complete(self) -> None:
        self._head_since_s = None
        self._door.waiting.pop(self, None)
        super().on_headers_complete()
        self.cycle.transport = _PoliteTransport(self)  # type: ignore[assignment]

    def send_400_response(self, msg: str) -> None:
        self._refuse(MALFORMED)

    @property
    def _in_progress(self) -> bool:
        return self.cycle is not None and not self.cycle.response_complete

    def _wait_for_a_head(self) -> None:
        self._head_since_s, self._head_bytes = self.loop.time(), 0
        self._door.waiting[self] = None

    def _look_again(self) -> None:
        period_s = min(self._limits.head_s, self._limits.idle_s) / 4
        self._check = self.loop.call_later(period_s, self._look)

    def _look(self) -> None:
        """Still moving?"""
        if self._deaf or self.transport.is_closing():
            return
        now_s = self.loop.time()
        if self._head_since_s is not None and now_s - self._head_since_s > self._limits.head_s:
            self._refuse(TOO_SLOW)
            return
        unsent = self.transport.get_write_buffer_size()
        if unsent != self._unsent:
            self._unsent, self._moved_s = unsent, now_s
        stuck = self.flow.write_paused or (self._in_progress and self.cycle.more_body and not self.flow.read_paused)
        if stuck and now_s - self._moved_s > self._limits.idle_s:
            self.transport.abort()
            return
        self._look_again()

    def _refuse(self, refusal: Refusal) -> None:
        """A problem, unless it would fall into the middle of an answer; the connection ends."""
        self._head_since_s = None
        if not self._in_progress:
            self.transport.write(_answer(refusal))
            self.linger()
        else:
            self.transport.close()

    def linger(self) -> None:
        """Everything is said; what still comes is not heard."""
        if self._deaf or self.transport.is_closing():
            return
        self._deaf = True
        if self.transport.can_write_eof():
            self.transport.write_eof()
        self.flow.resume_reading()
        self.loop.call_later(self._limits.linger_s, self.transport.close)


class _PoliteTransport:
    """What an answer is written to; it is closed only when the client has been heard out."""

    def __init__(self, connection: GuardedConnection) -> None:
        self._connection, self._transport = connection, connection.transport
        self.write, self.is_closing = self._transport.write, self._transport.is_closing

    def close(self) -> None:
        cycle = self._connection.cycle
        if cycle.more_body and cycle.response_complete:
            self._connection.linger()
        else:
            self._transport.close()


def _answer(refusal: Refusal) -> bytes:
    status, code, detail, fix = refusal
    problem = Problem.of(status, code, detail, fix)
    body = problem.model_dump_json(exclude_none=True).encode()
    head = f"HTTP/1.1 {status} {problem.title}\r\nContent-Type: {MEDIA_TYPE}\r\nContent-Length: {len(body)}\r\n"
    return f"{head}Connection: close\r\n\r\n".encode() + body
