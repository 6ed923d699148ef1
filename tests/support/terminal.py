"""Commands started as a terminal starts them."""

import os
import pty
import signal
import subprocess
from dataclasses import dataclass
from typing import Any


def started(command: list[str], **options: Any) -> "subprocess.Popen[Any]":
    """The command, listening to Ctrl-C also when whoever runs the tests ignores it (a background job does)."""
    before = signal.getsignal(signal.SIGINT)
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # an ignored signal is inherited, a caught one is not
    try:
        return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, **options)
    finally:
        signal.signal(signal.SIGINT, before)


@dataclass(frozen=True)
class OnTerminal:
    """What a command answered, and what somebody saw who sat before it meanwhile."""

    status: int
    out: bytes
    shown: str


def on_terminal(command: list[str]) -> OnTerminal:
    """Run it with standard error on a terminal."""
    master, slave = pty.openpty()
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=slave) as running:
        os.close(slave)
        shown = _read_all(master)
        out, _ = running.communicate()
    os.close(master)
    return OnTerminal(running.returncode, out, shown)


def _read_all(terminal: int) -> str:
    """What was written to a terminal whose other end is closed."""
    shown = b""
    while True:
        try:
            piece = os.read(terminal, 65536)
        except OSError:  # Linux says so when the last writer has gone
            return shown.decode()
        if not piece:
            return shown.decode()
        shown += piece
