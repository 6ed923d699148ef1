"""Says where the daemon hangs before the watchdog ends it: the stacks of all threads and tasks, on standard error.

A thread of its own writes them, because the event loop may be what hangs. Where C code never gives Python's lock back
it cannot either: then faulthandler writes the threads when systemd's SIGABRT comes.
"""

import asyncio
import io
import sys
import threading
import traceback
from collections.abc import Callable, Iterator

MAX_LINES = 1000


class HangReport:
    """A thread that writes one report when nobody calls `note` for `limit_s`, and the next after another `note`."""

    def __init__(self, limit_s: float, write: Callable[[str], None]) -> None:
        """`write` takes one line."""
        self._limit_s, self._write = limit_s, write
        self._noted, self._ending = threading.Event(), False
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Begin to watch the event loop that this is called in."""
        self._loop = asyncio.get_running_loop()
        self._thread = threading.Thread(target=self._watch, args=(self._loop,), name="hang report", daemon=True)
        self._thread.start()

    def note(self) -> None:
        """The work is alive."""
        self._noted.set()

    def stop(self) -> None:
        """End the thread."""
        self._ending = True
        self._noted.set()
        if self._thread is not None:
            self._thread.join()

    def _watch(self, loop: asyncio.AbstractEventLoop) -> None:
        reported = False
        while not self._ending:
            if self._noted.wait(self._limit_s):
                self._noted.clear()
                reported = False
            elif not reported:
                reported = True
                for line in stacks(loop, self._limit_s):
                    self._write(line)


def stacks(loop: asyncio.AbstractEventLoop, hung_s: float) -> list[str]:
    """Lines: the stack of each thread and of each task of the loop, MAX_LINES at the most."""
    names = {thread.ident: thread.name for thread in threading.enumerate()}
    lines = [f"nothing has gone on for {hung_s:.0f} s; where each thread and task stands:"]
    for ident, frame in sys._current_frames().items():
        if ident != threading.get_ident():
            lines.append(f"thread {names.get(ident, ident)}:")
            lines += _split("".join(traceback.format_stack(frame)))
    for task in _tasks_of(loop):
        text = io.StringIO()
        task.print_stack(file=text)
        lines.append(f"task {task.get_name()}:")
        lines += _split(text.getvalue())
    return lines[:MAX_LINES]


def _split(text: str) -> Iterator[str]:
    return (line.rstrip() for line in text.splitlines() if line.strip())


def _tasks_of(loop: asyncio.AbstractEventLoop) -> "list[asyncio.Task[object]]":
    """The tasks that are not done; none where the loop goes on and changes them all the time."""
    for _ in range(10):
        try:
            return sorted(asyncio.all_tasks(loop), key=lambda task: task.get_name())
        except RuntimeError:  # it was changed during the look
            continue
    return []
