"""Limits of HTTP connections: time and size of a request's head, idle time, and their number.

uvicorn keeps a connection open whose head never ends, and answers what it cannot parse in plain text. Here a head has
limits in time and bytes, a body or an answer without progress is cut off, and at the limit of connections the one that
has been waiting for a head longest is closed for a new one.
"""

import asyncio
import resource
from dataclasses import dataclass, field
from typing import Any

from uvicorn.protocols.http.flow_control import HIGH_WATER_LIMIT
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from daemon.http.problem_details import MEDIA_TYPE, Problem
from daemon.http.receive_buffer import BufferedConnection, SharedBuffer
from daemon.http.tls_handshake import PendingTlsConnection

MALFORMED = (400, "request-malformed", "this is not an HTTP/1.1 request", "send one; for TLS use https://")
TOO_SLOW = (408, "request-too-slow", "the request's head did not come in time", "send it in one go")
TOO_LONG = (431, "head-too-large", "the request's head is too large", "send fewer or shorter headers")
TOO_MANY = (503, "too-many-connections", "too many connections are open", "close some, and ask again")

Refusal = tuple[int, str, str, str]

SPARE_DESCRIPTORS = 256
"""Descriptors reserved for files, devices and the store."""


@dataclass(frozen=True)
class HttpLimits:
    """Limits of one connection and of their number. `idle_s`: without progress of a body or an answer.

    `linger_s`: how long input is discarded after the last answer before closing. After closing at once the system would
    answer further input with a reset, and the client might never read why it was refused.
    """

    head_s: float = 10.0
    head_bytes: int = 65_536
    idle_s: float = 60.0
    linger_s: float = 2.0
    connections: int = 4000


@dataclass(eq=False)
class ConnectionLimiter:
    """Limits the connections of one server. `waiting`: those without a complete head, longest waiting first."""

    limits: HttpLimits = field(
        default_factory=lambda: HttpLimits(connections=_reserve_descriptors(HttpLimits.connections))
    )
    waiting: "dict[LimitedConnection | PendingTlsConnection, None]" = field(default_factory=dict)
    handshakes: set[PendingTlsConnection] = field(default_factory=set)
    buffer: SharedBuffer = field(default_factory=SharedBuffer)
    _established: set[Any] = field(default_factory=set)

    def protocol(self, handshake: PendingTlsConnection | None = None, **arguments: Any) -> BufferedConnection:
        """The protocol factory for `uvicorn.Config(http=...)`. `handshake`: the connection's finished TLS handshake."""
        self._established = arguments["server_state"].connections
        return BufferedConnection(LimitedConnection(self, handshake, **arguments), self.buffer)

    def make_room(self) -> bool:
        """Make room for one more connection by closing the longest waiting one. False when none is waiting."""
        if len(self._established) + len(self.handshakes) < self.limits.connections:
            return True
        for oldest in self.waiting:
            oldest.abort()
            del self.waiting[oldest]
            return True
        return False

    def admit(self, newcomer: PendingTlsConnection) -> bool:
        """Register a TLS handshake. False when there is no room for it."""
        if not self.make_room():
            return False
        self.handshakes.add(newcomer)
        self.waiting[newcomer] = None
        return True

    def release(self, one: PendingTlsConnection) -> None:
        """Remove a TLS handshake that has ended."""
        self.handshakes.discard(one)
        self.waiting.pop(one, None)

    def close(self) -> None:
        """Abort all TLS handshakes."""
        for handshake in self.handshakes:
            handshake.abort()


def _reserve_descriptors(wanted: int) -> int:
    """Raise the descriptor limit for `wanted` connections; returns how many it allows."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    needed = wanted + SPARE_DESCRIPTORS
    if soft < needed:
        soft = needed if hard == resource.RLIM_INFINITY else min(needed, hard)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    return max(16, min(wanted, soft - SPARE_DESCRIPTORS))


class LimitedConnection(HttpToolsProtocol):
    """uvicorn's HTTP connection with the limits of HttpLimits."""

    def __init__(self, limiter: ConnectionLimiter, handshake: PendingTlsConnection | None, **arguments: Any) -> None:
        super().__init__(**arguments)
        self._handshake = handshake
        self._limiter, self._limits = limiter, limiter.limits
        self._head_since_s: float | None = None
        self._head_bytes = 0
        self._last_progress_s = 0.0
        self._unsent = 0
        self._lingering = False
        self._timer: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        if self._handshake is not None:
            self._limiter.release(self._handshake)
        welcome = self._limiter.make_room()
        super().connection_made(transport)
        self._last_progress_s = self.loop.time()
        if not welcome:
            self._refuse(TOO_MANY)
            return
        self._start_head_timer()
        self._schedule_check()

    def abort(self) -> None:
        """Close the connection at once, to make room for another."""
        self.transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._limiter.waiting.pop(self, None)
        super().connection_lost(exc)

    def data_received(self, data: bytes | memoryview) -> None:
        if self._lingering or self.transport.is_closing():
            return
        self._last_progress_s = self.loop.time()
        if self._head_since_s is None and not self._in_progress:
            self._start_head_timer()
        super().data_received(data)  # type: ignore[arg-type] # httptools reads any buffer, and keeps copies
        if self._head_since_s is not None:
            self._head_bytes += len(data)
            if self._head_bytes > self._limits.head_bytes:
                self._refuse(TOO_LONG)

    def on_body(self, body: bytes) -> None:
        """Like uvicorn's, but pass a chunk on without copying when no other is pending: saves two copies of a cloud."""
        if self.cycle.body or self.cycle.response_complete or self.parser.should_upgrade():
            super().on_body(body)
            return
        self.cycle.body = body  # type: ignore[assignment]
        if len(body) > HIGH_WATER_LIMIT:
            self.flow.pause_reading()
        self.cycle.message_event.set()

    def on_headers_complete(self) -> None:
        self._head_since_s = None
        self._limiter.waiting.pop(self, None)
        super().on_headers_complete()
        self.cycle.transport = _LingeringTransport(self)  # type: ignore[assignment]

    def send_400_response(self, msg: str) -> None:
        self._refuse(MALFORMED)

    @property
    def _in_progress(self) -> bool:
        return self.cycle is not None and not self.cycle.response_complete

    def _start_head_timer(self) -> None:
        self._head_since_s, self._head_bytes = self.loop.time(), 0
        self._limiter.waiting[self] = None

    def _schedule_check(self) -> None:
        period_s = min(self._limits.head_s, self._limits.idle_s) / 4
        self._timer = self.loop.call_later(period_s, self._check_timeouts)

    def _check_timeouts(self) -> None:
        """Enforce the head and idle timeouts, then schedule the next check."""
        if self._lingering or self.transport.is_closing():
            return
        now_s = self.loop.time()
        if self._head_since_s is not None and now_s - self._head_since_s > self._limits.head_s:
            self._refuse(TOO_SLOW)
            return
        unsent = self.transport.get_write_buffer_size()
        if unsent != self._unsent:
            self._unsent, self._last_progress_s = unsent, now_s
        stuck = self.flow.write_paused or (self._in_progress and self.cycle.more_body and not self.flow.read_paused)
        if stuck and now_s - self._last_progress_s > self._limits.idle_s:
            self.transport.abort()
            return
        self._schedule_check()

    def _refuse(self, refusal: Refusal) -> None:
        """Answer with a problem document, unless an answer is in progress, and close the connection."""
        self._head_since_s = None
        if not self._in_progress:
            self.transport.write(_answer(refusal))
            self.linger()
        else:
            self.transport.close()

    def linger(self) -> None:
        """The response is complete: read and discard what the client still sends, then close (lingering close)."""
        if self._lingering or self.transport.is_closing():
            return
        self._lingering = True
        if self.transport.can_write_eof():
            self.transport.write_eof()
        self.flow.resume_reading()
        self.loop.call_later(self._limits.linger_s, self.transport.close)


class _LingeringTransport:
    """A response's transport whose `close` lingers when the client may still be sending its body."""

    def __init__(self, connection: LimitedConnection) -> None:
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
