"""Limits how often the same thing is logged."""

from collections.abc import Callable
from dataclasses import dataclass

INTERVAL_S = 60.0
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
