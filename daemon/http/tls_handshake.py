"""TLS listener that counts handshakes among the connections.

asyncio reports a TLS connection only after its handshake, so a handshake that never finishes escapes the connection
limit. Here a connection is registered when it is accepted, its handshake has the time limit of a request's head, and it
may be closed to make room.
"""

import asyncio
import logging
import socket
import ssl
from collections.abc import Callable
from contextlib import suppress
from itertools import count
from typing import Protocol

from daemon.http.listen_socket import MAX_ACCEPTED_A_TURN

log = logging.getLogger(__name__)

PAUSE_S = 0.5
"""Pause after an accept that failed, usually for want of descriptors."""

SHUTDOWN_S = 2.0
"""How long the end of a TLS connection may take; meanwhile it keeps 100 kB. asyncio's default is 30 s."""


class PendingTlsConnection:
    """A connection during its TLS handshake."""

    def __init__(self, connection: socket.socket, address: str) -> None:
        """`address`: the client's IP address."""
        self._connection, self.address = connection, address
        self._begun = False
        self._task: asyncio.Task[None] | None = None

    def begin(
        self,
        follows: Callable[[], asyncio.BaseProtocol],
        context: ssl.SSLContext,
        limit_s: float,
        over: Callable[[], None],
    ) -> None:
        """Start the handshake; `over` is called when it is done or has failed."""
        self._task = asyncio.create_task(self._run(follows, context, limit_s), name="TLS handshake")
        self._task.add_done_callback(lambda _: self._finish(over))

    def displace(self) -> None:
        """Close the connection at once, to make room for another."""
        if self._task is not None:
            self._task.cancel()

    def _finish(self, over: Callable[[], None]) -> None:
        if not self._begun:
            self._connection.close()  # afterwards its transport closes it
        over()

    async def _run(self, follows: Callable[[], asyncio.BaseProtocol], context: ssl.SSLContext, limit_s: float) -> None:
        """Run the handshake. A failure is not logged: port scans would fill the log."""
        self._begun = True
        with suppress(OSError):  # ssl.SSLError is one
            await asyncio.get_running_loop().connect_accepted_socket(
                follows, self._connection, ssl=context, ssl_handshake_timeout=limit_s, ssl_shutdown_timeout=SHUTDOWN_S
            )


class HandshakeLimiter(Protocol):
    """Limits the number of handshakes; see ConnectionLimiter."""

    def admit(self, newcomer: PendingTlsConnection) -> None:
        """Give a place to a handshake."""
        ...

    def release(self, one: PendingTlsConnection) -> None:
        """Free the place of a handshake that has ended."""
        ...


class TlsListener:
    """Accepts TLS connections; takes the place of asyncio's server in uvicorn."""

    def __init__(
        self,
        listener: socket.socket,
        context: ssl.SSLContext,
        limit_s: float,
        limiter: HandshakeLimiter,
        follows: Callable[[PendingTlsConnection], asyncio.BaseProtocol],
    ) -> None:
        self._listener, self._context, self._limit_s = listener, context, limit_s
        self._limiter, self._make_protocol = limiter, follows
        self._handshakes: set[PendingTlsConnection] = set()
        listener.setblocking(False)
        self._task = asyncio.create_task(self._accept(), name="accepts TLS")

    def close(self) -> None:
        """Stop accepting connections, and abort all handshakes."""
        self._task.cancel()
        for handshake in self._handshakes:
            handshake.displace()

    async def wait_closed(self) -> None:
        """Wait until no more connections are accepted."""
        await asyncio.wait([self._task])

    async def _accept(self) -> None:
        loop = asyncio.get_running_loop()
        for accepted in count(1):
            if accepted % MAX_ACCEPTED_A_TURN == 0:
                await asyncio.sleep(0)
            try:
                connection, address = await loop.sock_accept(self._listener)
            except OSError as error:
                log.warning("a connection could not be accepted: %s", error)
                await asyncio.sleep(PAUSE_S)
                continue
            self._start_handshake(connection, address[0])

    def _start_handshake(self, connection: socket.socket, address: str) -> None:
        handshake = PendingTlsConnection(connection, address)
        self._handshakes.add(handshake)
        self._limiter.admit(handshake)
        handshake.begin(
            lambda: self._make_protocol(handshake), self._context, self._limit_s, lambda: self._finish(handshake)
        )

    def _finish(self, handshake: PendingTlsConnection) -> None:
        self._handshakes.discard(handshake)
        self._limiter.release(handshake)
