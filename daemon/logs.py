"""One line a record on standard output, for journald: level, run, logger, message."""

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_run: ContextVar[str] = ContextVar("run", default="-")


@contextmanager
def about_run(run_id: str) -> Iterator[None]:
    """Records made inside carry the run's id."""
    token = _run.set(run_id)
    try:
        yield
    finally:
        _run.reset(token)


class OneLine(logging.Formatter):
    """Whatever a message holds, it stays on its line, and no control character reaches the terminal."""

    def format(self, record: logging.LogRecord) -> str:
        text = f"{record.levelname} run={_run.get()} {record.name}: {super().format(record)}"
        return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def log_to_stdout(level: int = logging.INFO) -> None:
    """Send every record to standard output, one line each."""
    handler = logging.StreamHandler(sys.stdout)
    handler.setFormatter(OneLine())
    logging.basicConfig(level=level, handlers=[handler], force=True)
    logging.getLogger("httpx").setLevel(logging.WARNING)
