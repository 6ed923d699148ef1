"""Logging to standard output for journald, one line per record: priority, level, run, request, logger, message."""

import logging
import os
import re
import sys
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TextIO, TypeVar

Value = TypeVar("Value")
_run: ContextVar[str] = ContextVar("run", default="-")
_request: ContextVar[str] = ContextVar("request", default="-")

PRIORITIES = ((logging.CRITICAL, 2), (logging.ERROR, 3), (logging.WARNING, 4), (logging.INFO, 6), (logging.NOTSET, 7))
"""Priorities of syslog(3). journald reads <N> at the start of a line, so that `journalctl -p warning` filters by it."""

LIBRARY_MIN_LEVELS = {"httpx": logging.WARNING, "pymodbus.logging": logging.CRITICAL}
"""Minimum levels of libraries: what they log below them repeats our own records."""


@contextmanager
def within(variable: ContextVar[Value], value: Value) -> Iterator[None]:
    """The variable has the value inside the block, and in tasks that begin there."""
    token = variable.set(value)
    try:
        yield
    finally:
        variable.reset(token)


def about_run(run_id: str) -> AbstractContextManager[None]:
    """Log records made inside the block carry the run's id."""
    return within(_run, run_id)


def about_request(request_id: str) -> AbstractContextManager[None]:
    """Log records made inside the block, also by a run that it starts, carry the request's id."""
    return within(_request, request_id)


class OneLineFormatter(logging.Formatter):
    """Formats a record as one line; escapes line breaks and control characters, removes API keys."""

    def __init__(self, *, priorities: bool = False) -> None:
        """`priorities`: start each line with journald's <N>."""
        super().__init__()
        self._priorities = priorities

    def format(self, record: logging.LogRecord) -> str:
        ids = f"run={_run.get()} request={_request.get()}"
        text = f"{record.levelname} {ids} {record.name}: {super().format(record)}"
        printable = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
        line = redact_keys(printable)
        return f"<{priority(record.levelno)}>{line}" if self._priorities else line


def priority(level: int) -> int:
    """The syslog priority, 2 to 7, of a Python log level."""
    return next(number for least, number in PRIORITIES if level >= least)


def goes_to_journal(stream: TextIO, environment: Mapping[str, str] = os.environ) -> bool:
    """True when journald reads `stream`: JOURNAL_STREAM names its file, and terminals inherit the variable, too."""
    try:
        file = os.fstat(stream.fileno())
    except (OSError, ValueError):
        return False
    return environment.get("JOURNAL_STREAM") == f"{file.st_dev}:{file.st_ino}"


def print_error_line(line: str) -> None:
    """Write a line to standard error at once, without a logger: one may be what hangs."""
    priority = "<3>" if goes_to_journal(sys.stderr) else ""
    sys.stderr.write(f"{priority}{line}\n")
    sys.stderr.flush()


def log_to_stdout(level: int = logging.INFO, environment: Mapping[str, str] = os.environ) -> None:
    """Send all log records to standard output, one line each; with priorities when journald reads it."""
    handler = logging.StreamHandler(sys.stdout)
    handler.setFormatter(OneLineFormatter(priorities="JOURNAL_STREAM" in environment))
    logging.basicConfig(level=level, handlers=[handler], force=True)
    for name, least in LIBRARY_MIN_LEVELS.items():
        logging.getLogger(name).setLevel(least)


INTERVAL_S = 60.0
"""The same thing is logged once in so long."""

MAX_SUBJECTS = 100
"""Subjects counted apart; further ones are counted together."""

OTHERS = "others"


@dataclass
class _Line:
    at_s: float
    left_out: int = 0


class LogLimit:
    """Allows one line a minute for each subject, and counts those left out."""

    def __init__(self, clock: Callable[[], float]) -> None:
        """`clock`: monotonic seconds."""
        self._clock = clock
        self._lines: dict[str, _Line] = {}

    def left_out(self, subject: str) -> int | None:
        """None when no line about `subject` is due; else how many were left out since the last one."""
        now_s = self._clock()
        if subject not in self._lines and len(self._lines) >= MAX_SUBJECTS:
            self._lines = {each: line for each, line in self._lines.items() if now_s - line.at_s < INTERVAL_S}
            subject = subject if len(self._lines) < MAX_SUBJECTS else OTHERS
        line = self._lines.get(subject)
        if line is not None and now_s - line.at_s < INTERVAL_S:
            line.left_out += 1
            return None
        self._lines[subject] = _Line(now_s)
        return line.left_out if line else 0


KEY_FORM = r"hek_([0-9a-f]{8})_([0-9a-f]{64})"
"""An API key: its id and its secret."""

KEY_IN_TEXT = re.compile(r"hek(?:_|%5f)([0-9a-f]{8})(?:_|%5f)[0-9a-f]{8,}", re.IGNORECASE)
"""A key anywhere in a text, also one that is cut off, percent-encoded or in capitals."""


def redact_keys(text: str) -> str:
    """The text with the secret of every API key replaced; the key's id stays, so that it can be revoked."""
    return KEY_IN_TEXT.sub(r"hek_\1_[removed]", text)


MAX_LINES, MAX_LINE_LENGTH = 2000, 2000


class RecentLog(logging.Handler):
    """Keeps the last 2000 log lines of this process, each of at most 2000 characters, with their times."""

    def __init__(self) -> None:
        super().__init__()
        self.setFormatter(OneLineFormatter())
        self._lines: deque[str] = deque(maxlen=MAX_LINES)

    def emit(self, record: logging.LogRecord) -> None:
        at = datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds")
        self._lines.append(f"{at} {self.format(record)}"[:MAX_LINE_LENGTH])

    def text(self) -> str:
        """The lines, oldest first."""
        return "\n".join(self._lines.copy())
