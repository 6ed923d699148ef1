"""Modbus TCP server with pipelined requests and a limit on connections; a malformed connection is closed and logged.

pymodbus's own TCP server answers only the first of several pipelined requests, and none after a malformed header.
"""

import asyncio
import logging
import socket
from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

from protocols.modbus.errors import HeaderBroken
from protocols.modbus.mbap import Adu, MbapReader, RequestNumbers

log = logging.getLogger(__name__)

MAX_PIPELINED_REQUESTS = 32
"""Requests of one client answered before other clients are served."""

MAX_HALF_FRAME_S = 0.8
"""A connection is closed when the rest of a request takes longer than 0.8 s; normally it takes milliseconds."""

Respond = Callable[[bytes, bool], bytes]
"""Maps a request's PDU to the answer's PDU. True: an older request that comes again after newer ones."""


@dataclass(frozen=True)
class ModbusTcpLimits:
    """Maximum number of connections, and of seconds without a request.

    `has_priority`: addresses for which another connection is closed when the limit is reached.
    """

    connections: int
    idle_s: float
    half_frame_s: float = MAX_HALF_FRAME_S
    has_priority: Callable[[str], bool] = lambda _client: False


class ModbusTcp:
    """The listener and its connections. `respond_to` returns the function that answers a client, by its address."""

    def __init__(self, listener: socket.socket, respond_to: Callable[[str], Respond], limits: ModbusTcpLimits) -> None:
        self._listener, self._respond_to, self.limits = listener, respond_to, limits
        self._connections: set[_Connection] = set()
        self._full = False
        self._server: asyncio.Server | None = None

    @property
    def port(self) -> int:
        """The port that it listens on, also when port 0 was asked for."""
        return int(self._listener.getsockname()[1])

    @property
    def connections(self) -> int:
        return len(self._connections)

    async def start(self) -> None:
        self._server = await asyncio.get_running_loop().create_server(lambda: _Connection(self), sock=self._listener)

    async def stop(self) -> None:
        """Stop listening and close every connection."""
        if self._server is None:
            self._listener.close()
            return
        self._server.close()
        for connection in list(self._connections):
            connection.abort()
        await self._server.wait_closed()

    def admit(self, connection: "_Connection", client: str) -> Respond | None:
        """The answering function; None when the limit is reached, which is logged once until a connection ends."""
        if len(self._connections) >= self.limits.connections:
            self._make_room_for(client)
        if len(self._connections) >= self.limits.connections:
            if not self._full:
                log.warning("a PLC connection of %s is refused: %d are open already", client, self.connections)
            self._full = True
            return None
        self._connections.add(connection)
        return self._respond_to(client)

    def _make_room_for(self, client: str) -> None:
        """For a client with priority, close the connection without priority that has been silent longest."""
        others = [c for c in self._connections if not self.limits.has_priority(c.client)]
        if others and self.limits.has_priority(client):
            silent = min(others, key=lambda connection: connection.last_received_s)
            log.warning("a PLC connection of %s is closed: %s comes first", silent.client, client)
            self._connections.discard(silent)
            silent.abort()

    def remove(self, connection: "_Connection") -> None:
        if connection in self._connections:
            self._connections.remove(connection)
            self._full = False


class _Connection(asyncio.Protocol):
    """One client. Each request is answered before the next is parsed, so answers keep the order of the requests."""

    def __init__(self, server: ModbusTcp) -> None:
        self._server = server
        self._reader, self._numbers = MbapReader(), RequestNumbers()
        self._loop = asyncio.get_running_loop()
        self.client = "?"
        self._respond: Respond | None = None
        self.last_received_s = self._loop.time()
        self._timer: asyncio.TimerHandle | None = None
        self._transport: asyncio.Transport | None = None
        self._slow = self._working = self._closing = False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = transport = cast(asyncio.Transport, transport)  # uvloop's transport is not a subclass
        peer = transport.get_extra_info("peername")
        self.client = peer[0] if peer else "?"
        self._respond = self._server.admit(self, self.client)
        if self._respond is None:
            transport.abort()
            return
        self._schedule_check(self._server.limits.idle_s)

    def connection_lost(self, exc: Exception | None) -> None:
        self._server.remove(self)
        self._transport = None
        if self._timer is not None:
            self._timer.cancel()

    def data_received(self, data: bytes) -> None:
        if self._closing:
            return
        self.last_received_s = self._loop.time()
        self._answer_requests(data)

    def pause_writing(self) -> None:
        """Stop reading from a client that does not read its answers; the idle limit closes it."""
        self._slow = True
        self._pace()

    def resume_writing(self) -> None:
        self._slow = False
        if self._working:
            self._answer_requests()
        self._pace()

    def abort(self) -> None:
        if self._transport is not None:
            self._transport.abort()

    def _answer_requests(self, data: bytes = b"") -> None:
        """Answer up to MAX_PIPELINED_REQUESTS received requests, then let other connections run."""
        self._working = False
        transport, respond = self._transport, self._respond
        if transport is None or respond is None or self._closing or transport.is_closing():
            return
        answers = []
        try:
            for adu in self._reader.feed(data):
                pdu = respond(adu.pdu, self._numbers.is_repeated(adu))
                answers.append(Adu(adu.transaction, adu.unit, pdu).encode())
                if len(answers) >= MAX_PIPELINED_REQUESTS:
                    self._working = True
                    break
        except HeaderBroken as error:
            transport.write(b"".join(answers))
            self._close(f"it does not speak Modbus TCP: {error}")
            return
        transport.write(b"".join(answers))  # writelines does not pause the protocol in every Python
        if self._working and not self._slow:
            self._loop.call_soon(self._answer_requests)
        self._pace()
        if self._reader.half_frame_bytes and not self._working:
            self._schedule_check(self._server.limits.half_frame_s)

    def _pace(self) -> None:
        transport = self._transport
        if transport is None or self._closing or transport.is_closing():
            return
        if self._slow or self._working:
            transport.pause_reading()
        else:
            transport.resume_reading()

    def _schedule_check(self, limit_s: float) -> None:
        """Check the silence again once it may have lasted `limit_s`."""
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self._loop.call_at(self.last_received_s + limit_s, self._check_silence)

    def _check_silence(self) -> None:
        limits, silent_s = self._server.limits, self._loop.time() - self.last_received_s
        half = self._reader.half_frame_bytes
        if half and silent_s >= limits.half_frame_s:
            self._close(f"a request stopped after {half} bytes")
        elif silent_s >= limits.idle_s:
            self._close(f"it was silent for {limits.idle_s:g} s")
        else:
            self._schedule_check(limits.half_frame_s if half else limits.idle_s)

    def _close(self, why: str) -> None:
        """Log the reason, end the output and read on for 0.8 s: closing with unread input discards sent answers."""
        log.warning("a PLC connection of %s is closed: %s", self.client, why)
        self._closing = True
        if self._timer is not None:
            self._timer.cancel()
        if self._transport is not None:
            self._transport.resume_reading()
            self._transport.write_eof()
            self._timer = self._loop.call_later(MAX_HALF_FRAME_S, self.abort)
