"""A connection's socket in the hands of one thread, for the rest of a large body and for its answer.

The event loop takes a turn for each piece that comes or goes; a thread waits in the system instead. The limits in time
stay with the connection: it ends what exceeds them.
"""

import asyncio
import select
import socket
from collections.abc import Awaitable, Callable
from concurrent.futures import Executor
from contextlib import suppress
from typing import Protocol

from starlette.requests import ClientDisconnect

READ, WRITE = select.POLLIN, select.POLLOUT


class Lender(Protocol):
    """The connection whose socket is taken."""

    def note_progress(self, received: int) -> None:
        """So many bytes of the body were received; 0: some of the answer were sent. Called in the thread."""
        ...

    def take_back(self, taken: "TakenSocket") -> None:
        """The thread has ended."""
        ...


class TakenSocket:
    """Receives the `body_left` bytes of a body and sends `head` and answer, in one thread; only `wait` waits."""

    def __init__(self, lender: Lender, descriptor: int, body_left: int, threads: Executor) -> None:
        """`descriptor`: of the socket, which is not blocking; a duplicate, closed at the end of `run`."""
        self.body_left, self.sent = body_left, 0
        self.head = b""
        self.gone = False
        self.awaits_body = False
        self._lender, self._threads = lender, threads
        self._socket, self._poll = socket.socket(fileno=descriptor), select.poll()

    def add_head(self, data: bytes | bytearray | memoryview) -> None:
        """What the server writes of the answer's head, for the thread to send first."""
        self.head += data

    async def run(self, begin: Awaitable[None], exchange: Callable[["TakenSocket"], None]) -> None:
        """Await `begin`, which writes the answer's head; call `exchange` in a thread; give the socket back.

        Raises what they raise. When cancelled, the connection ends.
        """
        work: asyncio.Future[None] | None = None
        try:
            await begin
            work = asyncio.get_running_loop().run_in_executor(self._threads, exchange, self)
            await asyncio.shield(work)
        finally:
            try:
                if work is not None and not work.done():
                    self.end()
                    await asyncio.wait([work])
            finally:
                self._socket.close()
                self._lender.take_back(self)

    def end(self) -> None:
        """End the connection: the thread's next call raises ClientDisconnect."""
        self.gone = True
        with suppress(OSError):  # it has ended
            self._socket.shutdown(socket.SHUT_RDWR)

    def receive_into(self, room: memoryview) -> int:
        """Receive what has come of the body, at most what `room` holds; 0 when nothing has. Raises ClientDisconnect."""
        try:
            received = self._socket.recv_into(room[: self.body_left])
        except BlockingIOError:
            return 0
        except OSError:
            received = 0
        if not received:
            self.gone = True
            raise ClientDisconnect
        self.body_left -= received
        self._lender.note_progress(received)
        return received

    def send(self, data: memoryview) -> int:
        """Send as much as the client has room for; returns how much, 0 when it has none. Raises ClientDisconnect."""
        try:
            sent = self._socket.send(data)
        except BlockingIOError:
            return 0
        except OSError:
            self.gone = True
            raise ClientDisconnect from None
        self.sent += sent
        self._lender.note_progress(0)
        return sent

    def wait(self, events: int, timeout_s: float | None = None) -> bool:
        """Wait until bytes can be received (READ) or sent (WRITE), or the connection ends; False after `timeout_s`."""
        self.awaits_body = bool(events & READ)
        self._poll.register(self._socket, events)
        ready = self._poll.poll(None if timeout_s is None else 1000 * timeout_s)
        self.awaits_body = False
        return bool(ready)
