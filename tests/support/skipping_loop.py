"""An event loop whose time skips to its next timer when nothing else happens: an hour of waiting takes seconds."""

import asyncio
import selectors
import socket
import time
from collections.abc import Coroutine
from typing import Any, TypeVar

Result = TypeVar("Result")
GRACE_S = 2e-4
"""For what the kernel still delivers between two sockets of this process."""


class _SkippingSelector(selectors.DefaultSelector):
    """Waits for no timer. `unread`: a socket of a thread, which is waited for until it has read all."""

    def __init__(self) -> None:
        super().__init__()
        self.now_s = 0.0
        self.unread: socket.socket | None = None

    def select(self, timeout: float | None = None) -> Any:
        found = super().select(0)
        if found or timeout == 0:
            return found
        if timeout is None:
            return super().select(1.0)
        time.sleep(GRACE_S)
        found = super().select(0)
        while self.unread is not None and _has_data(self.unread):
            time.sleep(GRACE_S)
        self.now_s += 0.0 if found else timeout
        return found


def _has_data(sock: socket.socket) -> bool:
    try:
        sock.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT)
    except OSError:
        return False
    return True


class SkippingLoop(asyncio.SelectorEventLoop):
    """Its `time` begins at 0 and stands still while anything runs."""

    def __init__(self) -> None:
        self.selector = _SkippingSelector()
        super().__init__(self.selector)

    def time(self) -> float:
        """Seconds."""
        return self.selector.now_s


def run_skipping(act: Coroutine[Any, Any, Result]) -> Result:
    """The result of `act`, run in a SkippingLoop of its own."""
    with asyncio.Runner(loop_factory=SkippingLoop) as runner:
        return runner.run(act)
