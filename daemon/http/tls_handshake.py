"""TLS handshakes, counted among the connections.

A server that is given a certificate hears of a connection when its handshake is done: one that never ends is nobody's.
Here connections are accepted first, known from then on, have the time that a head has, and make room when there are too
many.
"""

import asyncio
import logging
import socket
import ssl
from collections.abc import Callable
from contextlib import suppress
from typing import Protocol

log = logging.getLogger(__name__)

PAUSE_S = 0.5
"""After an accept that the system refused, for want of descriptors mostly."""


class PendingTlsConnection:
    """A connection until its handshake is done."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection
        self._begun = False
        self._task: asyncio.Task[None] | None = None

    def begin(
        self,
        follows: Callable[[], asyncio.BaseProtocol],
        context: ssl.SSLContext,
        limit_s: float,
        over: Callable[[], None],
    ) -> None:
        """`over` is called when it is done, or has failed."""
        self._task = asyncio.create_task(self._run(follows, context, limit_s), name="TLS handshake")
        self._task.add_done_callback(lambda _: self._finish(over))

    def abort(self) -> None:
        """It has to go."""
        if self._task is not None:
            self._task.cancel()

    def _finish(self, over: Callable[[], None]) -> None:
        if not self._begun:
            self._connection.close()  # else its transport does
        over()

    async def _run(self, follows: Callable[[], asyncio.BaseProtocol], context: ssl.SSLContext, limit_s: float) -> None:
        """One that fails is not told: whoever scans the network would fill the log."""
        self._begun = True
        with suppress(OSError):  # ssl.SSLError is one
            await asyncio.get_running_loop().connect_accepted_socket(
                follows, self._connection, ssl=context, ssl_handshake_timeout=limit_s
            )


class HandshakeLimiter(Protocol):
    """Who lets connections in."""

    def admit(self, newcomer: PendingTlsConnection) -> bool:
        """May it stay? Room has been made for it where that was possible."""
        ...

    def release(self, one: PendingTlsConnection) -> None:
        """It is done, or gone."""
        ...


class TlsListener:
    """Accepts, and shakes hands; what asyncio's server is to uvicorn."""

    def __init__(
        self,
        listener: socket.socket,
        context: ssl.SSLContext,
        limit_s: float,
        crowd: HandshakeLimiter,
        follows: Callable[[PendingTlsConnection], asyncio.BaseProtocol],
    ) -> None:
        self._listener, self._context, self._limit_s = listener, context, limit_s
        self._limiter, self._make_protocol = crowd, follows
        listener.setblocking(False)
        self._task = asyncio.create_task(self._accept(), name="accepts TLS")

    def close(self) -> None:
        """Nobody comes in any more."""
        self._task.cancel()

    async def wait_closed(self) -> None:
        """Returns when that is so."""
        await asyncio.wait([self._task])

    async def _accept(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            try:
                connection, _ = await loop.sock_accept(self._listener)
            except OSError as error:
                log.warning("a connection could not be accepted: %s", error)
                await asyncio.sleep(PAUSE_S)
                continue
            self._start_handshake(connection)

    def _start_handshake(self, connection: socket.socket) -> None:
        handshake = PendingTlsConnection(connection)
        if not self._limiter.admit(handshake):
            connection.close()
            return
        handshake.begin(
            lambda: self._make_protocol(handshake),
            self._context,
            self._limit_s,
            lambda: self._limiter.release(handshake),
        )
