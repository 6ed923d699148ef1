"""Limits of one HTTP connection: time, size and number of what it may send, and one request at a time.

uvicorn keeps a connection open whose head never ends, takes any number of requests ahead, and answers what it cannot
parse in plain text. Here heads and bodies have limits in time and bytes, trailers are refused, an answer without
progress is cut off, and what follows a request is not parsed before that request is answered. Few connections are
parsed in one turn of the event loop (see request_pacing.py), aborts first.
"""

import asyncio
import mmap
import os
import select
from contextlib import suppress
from typing import Any, cast

import httptools
from uvicorn._types import ASGIReceiveEvent
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol, RequestResponseCycle

from daemon.http.accepting import ABORT_LINE
from daemon.http.connection_limiter import MAX_TAKEN, ConnectionLimiter
from daemon.http.listener import PendingConnection
from daemon.http.problem_details import MEDIA_TYPE, Problem
from daemon.http.receive_buffer import BUFFER_BYTES, BufferedConnection
from daemon.http.security_headers import with_security_headers
from daemon.http.taken_socket import TakenSocket


def _answer(status: int, code: str, detail: str, fix: str) -> bytes:
    """A whole answer, after which the connection is closed."""
    problem = Problem.of(status, code, detail, fix)
    body = problem.model_dump_json(exclude_none=True).encode()
    length = str(len(body)).encode()
    named = [(b"content-type", MEDIA_TYPE.encode()), (b"content-length", length), (b"connection", b"close")]
    lines = (b"%b: %b\r\n" % header for header in with_security_headers(named))
    return f"HTTP/1.1 {status} {problem.title}\r\n".encode() + b"".join(lines) + b"\r\n" + body


MALFORMED = _answer(
    400, "request-malformed", "this is not an HTTP/1.1 request", "send one, without trailers; for TLS use https://"
)
TOO_SLOW = _answer(408, "request-too-slow", "the request did not come in time", "send it in one go")
TOO_LONG = _answer(431, "head-too-large", "the request's head is too large", "send fewer or shorter headers")
TOO_MANY = _answer(503, "too-many-connections", "too many connections are open", "close some, and ask again")

MAX_CHUNK_BYTES = 65_536
"""Bytes parsed at once, except of a body with Content-Length."""

MAX_UNAUTHENTICATED_CHUNK_BYTES = 16_384
"""Bytes parsed at once until the connection has shown a valid key."""

HEAD_END = b"\r\n\r\n"
"""The end of a head and of a chunked body; llhttp takes no other."""

PACING = "pacing"
"""Key in a scope's `state`: the RequestPacing of the server, which an abort of a run in progress holds."""

ON_AUTHENTICATED = "on_authenticated"
"""Key in a scope's `state`: a function without arguments, to be called when the request has shown a valid key."""

LEND_BODY = "lend_body"
"""Key in a scope's `state`: a function without arguments, after which the pieces of a body with Content-Length come as
views of a buffer of the connection's own, each valid until the next piece is asked for. This saves two copies."""

TAKE_SOCKET = "take_socket"
"""Key in a scope's `state`: a function without arguments that returns the TakenSocket of a large body, or None."""


class LimitedConnection(HttpToolsProtocol):
    """uvicorn's HTTP connection with the limits of HttpLimits."""

    def __init__(self, limiter: ConnectionLimiter, pending: PendingConnection | None, **arguments: Any) -> None:
        super().__init__(**arguments)
        self._pending = pending
        self._limiter, self._limits = limiter, limiter.limits
        self._authenticated = False
        self._held = b""  # received, and not parsed before the request in progress is answered and a turn is free
        self._waiting = False  # for a turn
        self._head_since_s: float | None = None
        self._body_since_s: float | None = None
        self._body_waited_s = 0.0
        self._body_bytes = 0
        self._length_left = 0  # of a body with Content-Length
        self._own_buffer: memoryview | None = None  # for a body whose pieces are lent
        self._taken: TakenSocket | None = None
        self._was_taken = False  # for the body of this request: what follows it lies unread in the system
        self._overhead_bytes = 0  # since the last head or piece of a body: head, sizes of chunks, trailers
        self._refusal = MALFORMED  # of what the parser does not take
        self._last_progress_s = self._last_check_s = 0.0
        self._unsent = 0
        self._lingering = False
        self._timer: asyncio.TimerHandle | None = None

    @property
    def address(self) -> str:
        return self.client[0] if self.client else ""

    def room_in(self, shared: memoryview) -> memoryview:
        """Room for as many bytes as are parsed at once, or lent."""
        if not self._authenticated:
            return shared[:MAX_UNAUTHENTICATED_CHUNK_BYTES]
        return (self._own_buffer or shared)[: None if self._length_left else MAX_CHUNK_BYTES]

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        if self._pending is not None:
            self._limiter.release(self._pending)
        self._limiter.admit(self)
        self._last_progress_s = self._last_check_s = self.loop.time()
        self._start_head()
        self._schedule_check()

    def displace(self) -> None:
        answering = self._lingering or self.transport.get_write_buffer_size() or self._answer_has_begun
        if not answering and self.scheme == "http":  # TLS would wait for the client before closing
            self._drop_request()
            self.transport.write(TOO_MANY)
            self.transport.close()
        else:
            self.transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._limiter.release(self)
        self._held = b""
        if self._taken is not None:
            self._taken.end()
        super().connection_lost(exc)
        self._unset_keepalive_if_required()
        # Without these references the connection is freed at once, with the 100 kB that TLS keeps for it, and not when
        # the garbage collector comes by.
        self.cycle = self.scope = None  # type: ignore[assignment]

    def data_received(self, data: bytes | memoryview) -> None:
        if self._lingering or self.transport.is_closing():
            return
        self._last_progress_s = self.loop.time()
        if not self._held and not self._awaits_answer and self._limiter.pacing.take():
            self._parse(memoryview(data))
            return
        self._held += data
        self.flow.pause_reading()
        self._wait_for_turn()

    def _parse(self, data: memoryview) -> None:
        """Parse until a request is complete whose answer is not; hold back the rest, and read no more."""
        while data and not self._awaits_answer and not self._lingering and not self.transport.is_closing():
            length = min(len(data), self._length_left) or _next_end(bytes(data))
            self._feed(data[:length])
            data = data[length:]
        if data and not self._lingering:
            self._held = bytes(data)
            self.flow.pause_reading()

    def _wait_for_turn(self) -> None:
        """Parse what is held back when it is this connection's turn, unless a request of it is in progress."""
        if self._held and not self._waiting and not self._awaits_answer:
            self._waiting = True
            self._unset_keepalive_if_required()
            self._limiter.pacing.wait(self._parse_held, urgent=ABORT_LINE.match(self._held) is not None)

    def _parse_held(self) -> None:
        self._waiting = False
        if self._held and not self._awaits_answer and not self.transport.is_closing():
            held, self._held = self._held, b""
            self.flow.resume_reading()
            self._parse(memoryview(held))

    def _feed(self, piece: memoryview) -> None:
        """Parse a piece, or lend it past the parser as it lies in the connection's buffer."""
        if self._head_since_s is None and self._body_since_s is None:
            self._start_head()
        self._overhead_bytes += len(piece)
        self._unset_keepalive_if_required()
        if self._own_buffer is not None and self._length_left:
            self._count_body(len(piece))
            if not self.cycle.response_complete:
                cast(_LendingCycle, self.cycle).lend(piece)
            if not self._length_left:
                self._own_buffer = None
                self._end_unparsed_body()
            return
        try:
            self.parser.feed_data(piece)
        except httptools.HttpParserError:
            self._refuse(self._refusal)
        except httptools.HttpParserUpgrade:
            self.cycle.keep_alive = False  # it is answered as if it had not asked for another protocol
        if self._overhead_bytes > self._limits.head_bytes and not self._lingering:
            self._refuse(TOO_LONG)

    def on_header(self, name: bytes, value: bytes) -> None:
        """Refuse trailers, which would count as headers, and more headers than the limit."""
        if self._body_since_s is not None:
            raise ValueError("trailers are refused")
        if len(self.headers) >= self._limits.headers:
            self._refusal = TOO_LONG
            raise ValueError("too many headers")
        super().on_header(name, value)

    def on_headers_complete(self) -> None:
        super().on_headers_complete()
        self._head_since_s, self._body_since_s = None, self.loop.time()
        self._body_waited_s, self._body_bytes, self._overhead_bytes, self._was_taken = 0.0, 0, 0, False
        lengths = [int(value) for name, value in self.headers if name == b"content-length"]
        self._length_left = 0 if self.parser.should_upgrade() or not lengths else lengths[0]
        self.cycle.transport = _LingeringTransport(self)  # type: ignore[assignment]
        self.cycle.__class__ = _LendingCycle
        self.scope["state"][ON_AUTHENTICATED] = self._authenticate
        self.scope["state"][LEND_BODY] = self.lend_body
        self.scope["state"][TAKE_SOCKET] = self.take_socket
        self.scope["state"][PACING] = self._limiter.pacing

    def on_body(self, body: bytes) -> None:
        self._count_body(len(body))
        super().on_body(body)

    def _count_body(self, length: int) -> None:
        self._overhead_bytes = 0
        self._body_bytes += length
        self._length_left = max(0, self._length_left - length)

    def lend_body(self) -> None:
        """From here on pass the body on as it lies in a buffer of its own, where it is large."""
        if self._authenticated and self._length_left > MAX_CHUNK_BYTES:  # its pages take no memory until bytes come
            self._own_buffer = memoryview(mmap.mmap(-1, min(self._length_left, BUFFER_BYTES)))

    def take_socket(self) -> TakenSocket | None:
        """The socket for the rest of a large body with Content-Length, before the answer begins; its owner calls `run`.

        None over TLS, when a piece has come that was not asked for yet, and when all threads are in use.
        """
        if self.transport.is_closing() or self._lingering or self.cycle.disconnected:
            return None
        free = self._authenticated and self.scheme == "http" and self._limiter.taken < MAX_TAKEN
        come = self._held or self.cycle.body or self._own_buffer is not None
        if not free or come or self._length_left <= MAX_CHUNK_BYTES or self.transport.get_write_buffer_size():
            return None
        self.flow.pause_reading()
        descriptor = os.dup(self.transport.get_extra_info("socket").fileno())
        self._taken = TakenSocket(self, descriptor, self._length_left, self._limiter.threads)
        self._limiter.taken += 1
        self._was_taken = True
        self.cycle.transport.write = self._taken.add_head  # type: ignore[method-assign]
        return self._taken

    def note_progress(self, received: int) -> None:
        """The thread with the socket has received so many bytes of the body, or, with 0, sent some of the answer."""
        self._last_progress_s = self.loop.time()
        self._count_body(received)

    def take_back(self, taken: TakenSocket) -> None:
        """Go on with the connection after a whole exchange; end it when the client is gone."""
        self._taken = None
        self._limiter.taken -= 1
        if taken.gone:
            self._drop_request()
            self.transport.abort()
            return
        self.cycle.transport.write = self.transport.write  # type: ignore[method-assign]
        if not taken.body_left:
            self.cycle.expected_content_length -= taken.sent - len(taken.head)
            self._end_unparsed_body()

    def _end_unparsed_body(self) -> None:
        self.on_message_complete()
        self.parser = httptools.HttpRequestParser(self)  # the one before waits for the end of this body
        self.parser.set_dangerous_leniencies(lenient_data_after_close=True)  # as in uvicorn

    def on_message_complete(self) -> None:
        super().on_message_complete()
        self._body_since_s, self._overhead_bytes, self._length_left = None, 0, 0
        if not self._in_progress:  # it was answered before its body had come: the next head has the same limit
            self._start_head()

    def on_response_complete(self) -> None:
        super().on_response_complete()
        self._wait_for_turn()

    @property
    def unread(self) -> bool:
        """True when the client may have sent more than was read, so that closing at once would reset the connection."""
        return bool(self._held) or self._body_since_s is not None or self._was_taken

    @property
    def _in_progress(self) -> bool:
        return self.cycle is not None and not self.cycle.response_complete

    @property
    def _answer_has_begun(self) -> bool:
        return self._in_progress and bool(self.cycle.response_started)

    @property
    def _awaits_answer(self) -> bool:
        """True when a request is complete and its answer is not."""
        return self._in_progress and not self.cycle.more_body

    def _authenticate(self) -> None:
        if not self._authenticated:
            self._authenticated = True
            self._limiter.authenticate(self)

    def _start_head(self) -> None:
        self._head_since_s, self._overhead_bytes = self.loop.time(), 0

    def _schedule_check(self) -> None:
        period_s = min(self._limits.head_s, self._limits.body_s, self._limits.idle_s) / 4
        self._timer = self.loop.call_later(period_s, self._check_timeouts)

    def _check_timeouts(self) -> None:
        """Enforce the timeouts, then schedule the next check."""
        now_s, before_s = self.loop.time(), self._last_check_s
        self._last_check_s = now_s
        unsent = self.transport.get_write_buffer_size()
        if unsent != self._unsent:
            self._unsent, self._last_progress_s = unsent, now_s
        idle = now_s - self._last_progress_s > self._limits.idle_s
        reads = self._taken.awaits_body if self._taken is not None else not self.flow.read_paused
        if self._lingering or self.transport.is_closing():
            if idle:  # the client does not read the answer
                self.transport.abort()
        elif self._head_since_s is not None and now_s - self._head_since_s > self._limits.head_s:
            self._refuse(TOO_SLOW)
        elif self._body_since_s is not None and reads:
            self._body_waited_s += now_s - max(before_s, self._body_since_s)
            by_rate_s = self._limits.idle_s + self._body_bytes / self._limits.body_bytes_per_s
            if idle or self._body_waited_s > (by_rate_s if self._authenticated else self._limits.body_s):
                self._refuse(TOO_SLOW)
        elif self.flow.write_paused or self.flow.read_paused:
            waits_for_client = self.flow.write_paused or self._body_since_s is not None  # and not for the answer
            if (idle and waits_for_client) or (self._taken is None and self._has_hung_up()):
                self.transport.abort()
        self._schedule_check()

    def _has_hung_up(self) -> bool:
        """True when the end of the connection has arrived, which is not noticed otherwise while reading is paused."""
        poll = select.poll()
        poll.register(self.transport.get_extra_info("socket").fileno(), select.POLLRDHUP)
        return bool(poll.poll(0))

    def _refuse(self, answer: bytes) -> None:
        """Send this answer, unless another is in progress, and close the connection."""
        if self._answer_has_begun:
            self.transport.abort()
        else:
            self._drop_request()
            self.transport.write(answer)
            self.linger()

    def _drop_request(self) -> None:
        """Let the request in progress end as one whose client is gone."""
        if self._in_progress:
            self.cycle.disconnected = True
            self.cycle.message_event.set()

    def linger(self) -> None:
        """The response is complete: read and discard what the client still sends, then close (lingering close)."""
        if self._lingering or self.transport.is_closing():
            return
        self._lingering = True
        self._held = b""
        if self.transport.can_write_eof():
            with suppress(OSError):  # the client has reset the connection
                self.transport.write_eof()
        self.flow.resume_reading()
        self.loop.call_later(self._limits.linger_s, self.transport.close)


class _LendingCycle(RequestResponseCycle):
    """uvicorn's request with its answer, which passes a lent piece of a body on without copying it."""

    lent: memoryview | None = None

    def lend(self, piece: memoryview) -> None:
        """Pass this on with the next `receive`, and read nothing before the one after it."""
        assert self.lent is None  # since reading pauses
        self.lent = piece.toreadonly()
        self.flow.pause_reading()
        self.message_event.set()

    async def receive(self) -> ASGIReceiveEvent:
        if self.lent is None or self.disconnected or self.response_complete:
            message = await super().receive()
        else:  # without reading on: the piece lies where the next one would come
            self.message_event.clear()
            message = {"type": "http.request", "body": bytes(self.body), "more_body": self.more_body}
            self.body = bytearray()
        if self.lent is not None and message["type"] == "http.request":
            before = message["body"]  # parsed before the body was lent
            message["body"] = before + self.lent if before else self.lent  # type: ignore[typeddict-item]
            self.lent = None
        return message


class _LingeringTransport:
    """A response's transport whose `close` lingers when the client may still be sending."""

    def __init__(self, connection: LimitedConnection) -> None:
        self._connection, self._transport = connection, connection.transport
        self.write, self.is_closing = self._transport.write, self._transport.is_closing

    def close(self) -> None:
        if self._connection.unread and self._connection.cycle.response_complete:
            self._connection.linger()
        else:
            self._transport.close()


def limited_connection(
    limiter: ConnectionLimiter, pending: PendingConnection | None = None, **arguments: Any
) -> BufferedConnection:
    """The protocol of one connection, for `uvicorn.Config(http=...)`. `pending`: what it was until now."""
    return BufferedConnection(LimitedConnection(limiter, pending, **arguments), limiter.buffer)


def _next_end(data: bytes) -> int:
    """How many bytes to parse before a request may be complete: up to the next end of a head or chunked body."""
    line_ends = len(data) - len(data.lstrip(b"\r\n"))  # the end may have begun in the bytes before
    if line_ends:
        return line_ends
    end = data.find(HEAD_END)
    return len(data) if end < 0 else end + len(HEAD_END)
