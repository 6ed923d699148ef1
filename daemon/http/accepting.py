"""Accepts connections as fast as they come, and lets few begin in each turn of the event loop, aborts first.

uvloop (libuv) accepts one connection in a turn and asyncio as many as may wait: either the queue of the system grows,
in which an abort waits behind everybody, and is dropped for a second or more once it is full, or a turn gets long.
"""

import asyncio
import logging
import re
import socket
from collections import deque
from collections.abc import Callable

log = logging.getLogger(__name__)

MAX_ACCEPTED_A_TURN = 256
"""Connections accepted in one turn of the event loop; each takes about 10 µs."""

MAX_WAITING = 1000
"""Accepted connections that wait to begin. The oldest are closed for newer ones: their clients have waited longest."""

PAUSE_S = 0.5
"""Pause after an accept that failed, usually for want of descriptors."""

HELD_S = 0.01
"""Interval of looking for aborts among those that wait while the others are held."""

ABORT_LINE = re.compile(rb"POST /runs/[^/ ]{1,64}/abort[ ?]")
"""The beginning of a request that goes before all others."""

MAX_ABORT_LINE_BYTES = 80

Begin = Callable[[socket.socket, str], None]
"""Takes over an accepted connection and its client's IP address."""


class Accepting:
    """Accepts the connections of `listener` and calls `begin` with at most `max_begun_a_turn` in a turn.

    While more wait than may begin, first come those that send an abort (as far as that can be read without TLS), then
    the newest: their clients are there still. While `held()`, the others wait.
    """

    def __init__(
        self, listener: socket.socket, begin: Begin, max_begun_a_turn: int, held: Callable[[], bool] = lambda: False
    ) -> None:
        self._listener, self._begin, self._max_begun, self._held = listener, begin, max_begun_a_turn, held
        self._waiting: deque[tuple[socket.socket, str]] = deque()
        self._scheduled = False
        self._pause: asyncio.TimerHandle | None = None
        self._loop = asyncio.get_running_loop()
        listener.setblocking(False)
        self._loop.add_reader(listener, self._accept)

    def close(self) -> None:
        """Accept no more, and close the connections that have not begun."""
        if self._pause is not None:
            self._pause.cancel()
        self._loop.remove_reader(self._listener)
        while self._waiting:
            self._waiting.pop()[0].close()

    def _accept(self) -> None:
        try:
            for _ in range(MAX_ACCEPTED_A_TURN):
                connection, address = self._listener.accept()
                connection.setblocking(False)
                self._waiting.append((connection, address[0]))
                if len(self._waiting) > MAX_WAITING:
                    self._waiting.popleft()[0].close()
        except (BlockingIOError, InterruptedError, ConnectionAbortedError):
            pass  # there are no more, or the next one is gone already
        except OSError as error:
            log.warning("a connection could not be accepted: %s", error)
            self._loop.remove_reader(self._listener)
            self._pause = self._loop.call_later(PAUSE_S, self._loop.add_reader, self._listener, self._accept)
        if not self._scheduled:
            self._begin_some()

    def _begin_some(self) -> None:
        """Begin with some of those that wait, and come again in the next turn while there are any."""
        held = self._held()
        if held or len(self._waiting) > self._max_begun:
            self._waiting = deque(sorted(self._waiting, key=lambda one: sends_abort(one[0])))  # stable: newest last
        for _ in range(min(self._max_begun, len(self._waiting))):
            if held and not sends_abort(self._waiting[-1][0]):
                break
            self._begin(*self._waiting.pop())
        self._scheduled = bool(self._waiting)
        if held and self._scheduled:
            self._loop.call_later(HELD_S, self._begin_some)
        elif self._scheduled:
            self._loop.call_soon(self._begin_some)


def sends_abort(connection: socket.socket) -> bool:
    """True when what has come over the connection, and was not read yet, begins like an abort."""
    try:
        return ABORT_LINE.match(connection.recv(MAX_ABORT_LINE_BYTES, socket.MSG_PEEK)) is not None
    except OSError:  # nothing has come, or the client is gone
        return False
