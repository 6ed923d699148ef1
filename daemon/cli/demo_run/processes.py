"""Child processes that announce themselves in a file, and end with us whatever happens."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

from daemon.cli.errors import CommandError

START_LIMIT_S = 30.0
END_LIMIT_S = 10.0
POLL_S = 0.05


@dataclass(frozen=True)
class Child:
    """A running process, what it announced, and where it writes what it has to say."""

    name: str
    process: "subprocess.Popen[bytes]"
    announcement: dict[str, Any]
    log: Path

    def ended(self) -> bool:
        return self.process.poll() is not None


@contextmanager
def child(name: str, module: Sequence[str], folder: Path) -> Iterator[Child]:
    """`python -m MODULE... --ready-file FILE`, ready; ended when the block is left. Raises CommandError."""
    ready, log = folder / f"{name}.json", folder / f"{name}.log"
    ready.unlink(missing_ok=True)
    command = [sys.executable, "-m", *module, "--ready-file", str(ready)]
    with log.open("wb") as output:
        # A session of its own: Ctrl-C in the terminal reaches us, and we end the children in order.
        process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=output, stderr=subprocess.STDOUT, start_new_session=True
        )
    try:
        yield Child(name, process, _announcement(name, process, ready, log), log)
    finally:
        _end(process)


def _announcement(name: str, process: "subprocess.Popen[bytes]", ready: Path, log: Path) -> dict[str, Any]:
    limit_s = time.monotonic() + START_LIMIT_S
    while not ready.exists():
        if process.poll() is not None:
            last = (log.read_text(errors="replace").strip().splitlines() or ["it said nothing"])[-1]
            raise CommandError(name, f"it ended while starting: {last}", f"see {log}")
        if time.monotonic() > limit_s:
            raise CommandError(name, f"it was not ready after {START_LIMIT_S:.0f} s", f"see {log}")
        time.sleep(POLL_S)
    announcement: dict[str, Any] = json.loads(ready.read_text())
    return announcement


def _end(process: "subprocess.Popen[bytes]") -> None:
    """SIGTERM, and SIGKILL for one that does not listen."""
    if process.stdin is not None:
        process.stdin.close()
    if process.poll() is None:
        process.terminate()
    try:
        process.wait(END_LIMIT_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


@contextmanager
def signals_as_exits() -> Iterator[None]:
    """SIGTERM and SIGHUP unwind the stack as Ctrl-C does, so that every child is ended."""

    def leave(number: int, frame: FrameType | None) -> None:
        raise SystemExit(128 + number)

    before = {number: signal.signal(number, leave) for number in (signal.SIGTERM, signal.SIGHUP)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
