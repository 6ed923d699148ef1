"""Ports for what a test starts itself, where port 0 cannot be said."""

import fcntl
import secrets
import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

FIRST, BEYOND = 20_000, 32_768
"""The system gives ports from 32,768 on to whoever asks for any, and to connections: one of those would be taken before
what it is meant for listens."""

_given: set[int] = set()


def free_port(kind: socket.SocketKind = socket.SOCK_STREAM) -> int:
    """A port that nobody listens at, each time another one."""
    while True:
        port = FIRST + secrets.randbelow(BEYOND - FIRST)
        with socket.socket(type=kind) as free, suppress(OSError):
            free.bind(("127.0.0.1", port))
            if port not in _given:
                _given.add(port)
                return port


@contextmanager
def usual_port() -> Iterator[None]:
    """Nobody else of these tests starts meanwhile what looks for the daemon's usual port, and takes it only later."""
    with (Path(tempfile.gettempdir()) / "handeyed-usual-port").open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        yield
