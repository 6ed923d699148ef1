"""Exit statuses and errors of commands.

Every line on standard error is `file: place: what: what to do`; exit statuses are fixed:
0 done (solve: every calibration accepted), 1 failed, 2 unreadable input, 3 solved or refused but not accepted.
"""

from enum import IntEnum
from math import isfinite


class ExitStatus(IntEnum):
    OK = 0
    FAILED = 1
    UNREADABLE = 2
    NOT_ACCEPTED = 3


class CommandError(Exception):
    """A command failed: `where` (a file, an address), `what`, `fix`, and the exit status."""

    def __init__(self, where: str, what: str, fix: str, status: ExitStatus = ExitStatus.FAILED) -> None:
        self.where, self.what, self.fix, self.status = where, what, fix, status
        super().__init__(f"{where}: {what}: {fix}")


class UnreadableInput(CommandError):
    """An option or a file that cannot be used: exit status 2."""

    def __init__(self, where: str, what: str, fix: str) -> None:
        super().__init__(where, what, fix, ExitStatus.UNREADABLE)


def require_finite(**options: float | None) -> None:
    """Numbers of options by name; their bounds let nan through. Raises CommandError."""
    for name, value in options.items():
        if value is not None and not isfinite(value):
            where = f"--{name.replace('_', '-')}"
            raise UnreadableInput(where, f"{value} is not possible", "give a finite number")
