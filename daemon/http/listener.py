"""Listener that counts connections from the moment they are accepted, with or without TLS.

asyncio reports a TLS connection only after its handshake, so a handshake that never finishes escapes the connection
limit. Here a connection is registered before its handshake, which has the time limit of a request's head, and may be
closed to make room.
"""

import asyncio
import socket
import ssl
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from daemon.http.accepting import Accepting
from daemon.http.connection_limiter import ConnectionLimiter

MAX_BEGUN_A_TURN, MAX_HANDSHAKES_BEGUN_A_TURN = 4, 4
"""Connections begun in one turn of the event loop without TLS, and with it; each costs about 0.1 ms, and 1 ms."""

SHUTDOWN_S = 2.0
"""How long the end of a TLS connection may take; meanwhile it keeps 100 kB. asyncio's default is 30 s."""


class PendingConnection:
    """An accepted connection until its protocol has taken over: with TLS, during the handshake."""

    def __init__(self, connection: socket.socket, address: str) -> None:
        """`address`: the client's IP address."""
        self._connection, self.address = connection, address
        self._begun = False
        self._task: asyncio.Task[None] | None = None

    def begin(self, follows: Callable[[], asyncio.BaseProtocol], tls: dict[str, Any], over: Callable[[], None]) -> None:
        """Make the transport, with `tls` after the handshake; `over` is called when it is done or has failed."""
        self._task = asyncio.create_task(self._run(follows, tls), name="begins a connection")
        self._task.add_done_callback(lambda _: self._finish(over))

    def displace(self) -> None:
        if self._task is not None:
            self._task.cancel()

    def _finish(self, over: Callable[[], None]) -> None:
        if not self._begun:
            self._connection.close()  # afterwards its transport closes it
        over()

    async def _run(self, follows: Callable[[], asyncio.BaseProtocol], tls: dict[str, Any]) -> None:
        """Run the handshake. A failure is not logged: port scans would fill the log."""
        self._begun = True
        with suppress(OSError):  # ssl.SSLError is one
            await asyncio.get_running_loop().connect_accepted_socket(follows, self._connection, **tls)


class HttpListener:
    """Accepts connections; takes the place of asyncio's server in uvicorn.

    `context`: of TLS; None without. `limit_s`: of a handshake. `follows`: makes the protocol of a connection.
    """

    def __init__(
        self,
        listener: socket.socket,
        context: ssl.SSLContext | None,
        limit_s: float,
        limiter: ConnectionLimiter,
        follows: Callable[[PendingConnection], asyncio.BaseProtocol],
    ) -> None:
        self._limiter, self._make_protocol = limiter, follows
        self._tls = {} if context is None else {
            "ssl": context, "ssl_handshake_timeout": limit_s, "ssl_shutdown_timeout": SHUTDOWN_S
        }  # fmt: skip
        self._pending: set[PendingConnection] = set()
        most = MAX_BEGUN_A_TURN if context is None else MAX_HANDSHAKES_BEGUN_A_TURN
        self._accepting = Accepting(listener, self._begin, most, lambda: limiter.pacing.held)

    def close(self) -> None:
        """Stop accepting connections, and abort all that are pending."""
        self._accepting.close()
        for pending in self._pending:
            pending.displace()

    async def wait_closed(self) -> None:
        """Nothing is left to wait for: `close` has stopped accepting."""

    def _begin(self, connection: socket.socket, address: str) -> None:
        pending = PendingConnection(connection, address)
        self._pending.add(pending)
        self._limiter.admit(pending)
        pending.begin(lambda: self._make_protocol(pending), self._tls, lambda: self._finish(pending))

    def _finish(self, pending: PendingConnection) -> None:
        self._pending.discard(pending)
        self._limiter.release(pending)
