"""Modbus TCP for a plant: pipelined requests, a cap on connections, and a bad one closed at once and told once.

pymodbus's own TCP server answers only the first of several pipelined requests and stays deaf after a bad header.
"""

import asyncio
import logging
import socket
from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

from protocols.modbus.errors import HeaderBroken
from protocols.modbus.mbap import Adu, MbapReader

log = logging.getLogger(__name__)

AT_ONCE = 32
"""Requests of one client answered before others have their turn."""

HALF_FRAME_LIMIT_S = 0.8
"""The rest of a request comes within milliseconds, or never."""

Respond = Callable[[bytes], bytes]
"""From a request's PDU to the answer's."""


@dataclass(frozen=True)
class Limits:
    """Connections at a time, and how long one may be silent. `comes_first`: clients for whom another makes room."""

    connections: int
    idle_s: float
    half_frame_s: float = HALF_FRAME_LIMIT_S
    comes_first: Callable[[str], bool] = lambda _client: False


class ModbusTcp:
    """The listener and its connections. `respond_to` makes the answering function for a client's address."""

    def __init__(self, listener: socket.socket, respond_to: Callable[[str], Respond], limits: Limits) -> None:
        self._listener, self._respond_to, self.limits = listener, respond_to, limits
        self._connections: set[_Connection] = set()
        self._full = False
        self._server: asyncio.Server | None = None

    @property
    def port(self) -> int:
        """Where it really listens: port 0 lets the system choose."""
        port: int = self._listener.getsockname()[1]
        return port

    @property
    def connections(self) -> int:
        return len(self._connections)

    async def start(self) -> None:
        self._server = await asyncio.get_running_loop().create_server(lambda: _Connection(self), sock=self._listener)

    async def stop(self) -> None:
        """No more connections, and every one closed."""
        if self._server is None:
            self._listener.close()
            return
        self._server.close()
        for connection in list(self._connections):
            connection.abort()
        await self._server.wait_closed()

    def admit(self, connection: "_Connection", client: str) -> Respond | None:
        """The answering function; None when there are too many, which is told once until there are fewer."""
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
        """Whoever scans the network must not keep the PLC out: the longest silent of the others goes."""
        others = [c for c in self._connections if not self.limits.comes_first(c.client)]
        if others and self.limits.comes_first(client):
            silent = min(others, key=lambda connection: connection.heard_s)
            log.warning("a PLC connection of %s is closed: %s comes first", silent.client, client)
            self._connections.discard(silent)
            silent.abort()

    def left(self, connection: "_Connection") -> None:
        if connection in self._connections:
            self._connections.remove(connection)
            self._full = False


class _Connection(asyncio.Protocol):
    """One client. Answers are written in the order of their requests, before the next is looked at."""

    def __init__(self, server: ModbusTcp) -> None:
        self._server = server
        self._reader = MbapReader()
        self._loop = asyncio.get_running_loop()
        self.client = "?"
        self._respond: Respond | None = None
        self.heard_s = self._loop.time()
        self._timer: asyncio.TimerHandle | None = None
        self._transport: asyncio.Transport | None = None
        self._slow = self._working = self._closing = False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = transport = cast(asyncio.Transport, transport)  # uvloop's is none by descent
        peer = transport.get_extra_info("peername")
        self.client = peer[0] if peer else "?"
        self._respond = self._server.admit(self, self.client)
        if self._respond is None:
            transport.abort()
            return
        self._watch(self._server.limits.idle_s)

    def connection_lost(self, exc: Exception | None) -> None:
        self._server.left(self)
        self._transport = None
        if self._timer is not None:
            self._timer.cancel()

    def data_received(self, data: bytes) -> None:
        if self._closing:
            return
        self.heard_s = self._loop.time()
        self._work(data)

    def pause_writing(self) -> None:
        """A client that asks and does not read gets no more answers made; the idle limit ends it."""
        self._slow = True
        self._pace()

    def resume_writing(self) -> None:
        self._slow = False
        if self._working:
            self._work()
        self._pace()

    def abort(self) -> None:
        if self._transport is not None:
            self._transport.abort()

    def _work(self, data: bytes = b"") -> None:
        """Some of what has come, then the others' turn."""
        self._working = False
        transport, respond = self._transport, self._respond
        if transport is None or respond is None or self._closing or transport.is_closing():
            return
        answers = []
        try:
            for adu in self._reader.feed(data):
                answers.append(Adu(adu.transaction, adu.unit, respond(adu.pdu)).encode())
                if len(answers) >= AT_ONCE:
                    self._working = True
                    break
        except HeaderBroken as error:
            transport.write(b"".join(answers))
            self._close(f"it does not speak Modbus TCP: {error}")
            return
        transport.write(b"".join(answers))  # writelines does not pause the protocol in every Python
        if self._working and not self._slow:
            self._loop.call_soon(self._work)
        self._pace()
        if self._reader.half_frame_bytes and not self._working:
            self._watch(self._server.limits.half_frame_s)

    def _pace(self) -> None:
        transport = self._transport
        if transport is None or self._closing or transport.is_closing():
            return
        if self._slow or self._working:
            transport.pause_reading()
        else:
            transport.resume_reading()

    def _watch(self, limit_s: float) -> None:
        """Look again when the client may have been silent for too long."""
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self._loop.call_at(self.heard_s + limit_s, self._look)

    def _look(self) -> None:
        limits, silent_s = self._server.limits, self._loop.time() - self.heard_s
        half = self._reader.half_frame_bytes
        if half and silent_s >= limits.half_frame_s:
            self._close(f"a request stopped after {half} bytes")
        elif silent_s >= limits.idle_s:
            self._close(f"it was silent for {limits.idle_s:g} s")
        else:
            self._watch(limits.half_frame_s if half else limits.idle_s)

    def _close(self, why: str) -> None:
        """Told once. The client is heard out for a moment: a socket closed over unread bytes takes answers back."""
        log.warning("a PLC connection of %s is closed: %s", self.client, why)
        self._closing = True
        if self._timer is not None:
            self._timer.cancel()
        if self._transport is not None:
            self._transport.resume_reading()
            self._transport.write_eof()
            self._timer = self._loop.call_later(HALF_FRAME_LIMIT_S, self.abort)
