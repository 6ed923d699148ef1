"""Child processes that write a ready file, and are ended with this process."""

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
from daemon.runtime.module_names import module_name

MAX_START_S = 120.0
MAX_END_S = 10.0
POLL_S = 0.05


@dataclass(frozen=True)
class ChildProcess:
    """A running process, the content of its ready file, and its log file."""

    name: str
    process: "subprocess.Popen[bytes]"
    announcement: dict[str, Any]
    log: Path

    def is_running(self) -> bool:
        return self.process.poll() is None


@contextmanager
def start_child(name: str, module: Sequence[str], folder: Path) -> Iterator[ChildProcess]:
    """Run `python -m MODULE... --ready-file FILE` until the block ends; yields it once ready. Raises CommandError."""
    ready, log = folder / f"{name}.json", folder / f"{name}.log"
    ready.unlink(missing_ok=True)
    command = [sys.executable, "-P", "-m", module_name(module[0]), *module[1:], "--ready-file", str(ready)]
    with log.open("wb") as output:
        # A session of its own: Ctrl-C reaches only this process, which ends the children in order.
        process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=output, stderr=subprocess.STDOUT, start_new_session=True
        )
    try:
        yield ChildProcess(name, process, _wait_for_announcement(name, process, ready, log), log)
    finally:
        _end(process)


def _wait_for_announcement(name: str, process: "subprocess.Popen[bytes]", ready: Path, log: Path) -> dict[str, Any]:
    limit_s = time.monotonic() + MAX_START_S
    while not ready.exists():
        if process.poll() is not None:
            last = (log.read_text(errors="replace").strip().splitlines() or ["it said nothing"])[-1]
            raise CommandError(name, f"it ended while starting: {last}", f"see {log}")
        if time.monotonic() > limit_s:
            raise CommandError(name, f"it was not ready after {MAX_START_S:.0f} s", f"see {log}")
        time.sleep(POLL_S)
    announcement: dict[str, Any] = json.loads(ready.read_text())
    return announcement


def _end(process: "subprocess.Popen[bytes]") -> None:
    """End the process with SIGTERM, and with SIGKILL after MAX_END_S."""
    if process.stdin is not None:
        process.stdin.close()
    if process.poll() is None:
        process.terminate()
    try:
        process.wait(MAX_END_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


@contextmanager
def exit_on_signals() -> Iterator[None]:
    """Raise SystemExit on SIGTERM and SIGHUP, so that the children are ended."""

    def leave(number: int, frame: FrameType | None) -> None:
        raise SystemExit(128 + number)

    before = {number: signal.signal(number, leave) for number in (signal.SIGTERM, signal.SIGHUP)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
