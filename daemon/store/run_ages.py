"""How old runs are at least, by the hours that the daemon has been working since: no clock that can be set is asked."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

AGES_NAME = "retention.json"
"""In the store's folder."""

MARK_S = 24 * 3600.0
"""Working time between two marks."""

MAX_MARKS = 40_000
"""A hundred years of marks; keep_days is at most 36,500."""


@dataclass(frozen=True)
class RunAges:
    """The daemon's working time in seconds, and marks: the newest run at an earlier working time, oldest first.

    Working time is measured by the system's monotonic clock and summed over restarts. A run is at least as old as the
    working time since a mark at which it was there already; time while the daemon does not work is not counted.
    """

    worked_s: float = 0.0
    marks: tuple[tuple[float, str], ...] = ()

    def after(self, elapsed_s: float, newest_run: str | None) -> "RunAges":
        """The ages `elapsed_s` of working time later, when `newest_run` is the newest run."""
        worked_s = self.worked_s + max(0.0, elapsed_s)
        due = newest_run is not None and (not self.marks or worked_s - self.marks[-1][0] >= MARK_S)
        marks = (*self.marks, (worked_s, newest_run)) if due and newest_run is not None else self.marks
        return RunAges(worked_s, marks[-MAX_MARKS:])

    def older_than(self, limit_s: float, runs: Sequence[str]) -> set[str]:
        """Those of `runs`, newest first, that are certainly older."""
        passed = {run for marked_s, run in self.marks if self.worked_s - marked_s > limit_s}
        first = next((place for place, run in enumerate(runs) if run in passed), len(runs))
        return set(runs[first:])

    def json(self) -> bytes:
        return json.dumps({"worked_s": self.worked_s, "marks": self.marks}).encode()


def read_ages(folder: Path) -> RunAges:
    """The ages in the store's folder; new ones, by which every run is young, when they cannot be read."""
    try:
        content = json.loads((folder / AGES_NAME).read_bytes())
        return RunAges(float(content["worked_s"]), tuple((float(at), str(run)) for at, run in content["marks"]))
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return RunAges()
