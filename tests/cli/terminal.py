"""Commands started as a terminal starts them."""

import signal
import subprocess
from typing import Any


def started(command: list[str], **options: Any) -> "subprocess.Popen[Any]":
    """The command, listening to Ctrl-C also when whoever runs the tests ignores it (a background job does)."""
    before = signal.getsignal(signal.SIGINT)
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # an ignored signal is inherited, a caught one is not
    try:
        return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, **options)
    finally:
        signal.signal(signal.SIGINT, before)
