"""One line a record on standard output, for journald: priority, level, run, request, logger, message."""

import logging
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar

_run: ContextVar[str] = ContextVar("run", default="-")
_request: ContextVar[str] = ContextVar("request", default="-")

PRIORITIES = ((logging.CRITICAL, 2), (logging.ERROR, 3), (logging.WARNING, 4), (logging.INFO, 6), (logging.NOTSET, 7))
"""syslog(3)'s: journald reads <N> before a line, colours it, and `journalctl -p warning` finds it."""

LIBRARIES = {"httpx": logging.WARNING, "pymodbus.logging": logging.CRITICAL}
"""Below this they tell what our own records say in the words of the cell."""


@contextmanager
def about_run(run_id: str) -> Iterator[None]:
    """Records made inside carry the run's id."""
    token = _run.set(run_id)
    try:
        yield
    finally:
        _run.reset(token)


@contextmanager
def about_request(request_id: str) -> Iterator[None]:
    """Records made inside, also by a run that is started there, carry the request's id."""
    token = _request.set(request_id)
    try:
        yield
    finally:
        _request.reset(token)


def request_id() -> str:
    """The id that records carry here; - outside any request."""
    return _request.get()


class OneLine(logging.Formatter):
    """Whatever a message holds, it stays on its line, and no control character reaches the terminal."""

    def __init__(self, *, priorities: bool = False) -> None:
        """`priorities`: begin each line with journald's <N>."""
        super().__init__()
        self._priorities = priorities

    def format(self, record: logging.LogRecord) -> str:
        ids = f"run={_run.get()} request={_request.get()}"
        text = f"{record.levelname} {ids} {record.name}: {super().format(record)}"
        line = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
        return f"<{priority(record.levelno)}>{line}" if self._priorities else line


def priority(level: int) -> int:
    """journald's number for a level."""
    return next(number for least, number in PRIORITIES if level >= least)


def log_to_stdout(level: int = logging.INFO, environment: Mapping[str, str] = os.environ) -> None:
    """Send every record to standard output, one line each; with priorities when journald reads them."""
    handler = logging.StreamHandler(sys.stdout)
    handler.setFormatter(OneLine(priorities="JOURNAL_STREAM" in environment))
    logging.basicConfig(level=level, handlers=[handler], force=True)
    for name, least in LIBRARIES.items():
        logging.getLogger(name).setLevel(least)
