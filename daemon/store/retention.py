"""Deletes the pictures of old runs, and warns before the disk is full.

No clock that can be set decides: runs are ordered as they were stored, and aged by the hours that the daemon has been
working since.
"""

import asyncio
import json
import logging
from collections.abc import Iterable, Sequence, Set
from dataclasses import dataclass, field
from pathlib import Path

from calibration.sentences.sentence import Sentence
from daemon.config.settings import StorageSettings
from daemon.errors import StorageError
from daemon.model.records import RunRecord
from daemon.runtime.clock import Clock
from daemon.runtime.metrics import Metric
from daemon.runtime.tasks import InBackground
from daemon.runtime.workers import Workers
from daemon.store.database import storage_errors
from daemon.store.store import RUN_BYTES, Store

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


log = logging.getLogger(__name__)

INTERVAL_S = 3600.0
PAGE = 500
SIZE_SAMPLE_RUNS = 10
"""The size of a run is estimated as the mean of the latest 10."""

MIN_ROOM_RUNS = 100
"""Warn when fewer runs than this still fit: four days at one an hour."""


def runs_to_prune(runs: Sequence[RunRecord], keep_runs: int, old: Set[str], kept: Set[str]) -> list[str]:
    """Ids of the finished runs whose pictures are deleted; `runs` in the order they were stored, newest first.

    A run's pictures are kept while it is among the latest `keep_runs` and not in `old`, or when its id is in `kept`.
    The newest run is always kept.
    """
    return [
        run.id
        for place, run in enumerate(runs)
        if place > 0 and run.is_over and run.id not in kept and (place >= keep_runs or run.id in old)
    ]


@dataclass(eq=False)
class Retention(InBackground):
    """Background service: deletes the pictures of old runs at the start of the daemon and every hour."""

    store: Store
    workers: Workers
    clock: Clock
    settings: StorageSettings
    _run_bytes: float = field(default=0.0, init=False)
    _ages: RunAges | None = field(default=None, init=False)
    _aged_s: float | None = field(default=None, init=False)

    async def tidy(self) -> list[Path]:
        """Delete the pictures of old runs, unless the store has a fault; returns the files. Raises StorageError."""
        if self.store.fault is not None:
            return []
        runs = [run for run in await self._runs() if run.kind != "jog"]
        kept = await self.store.runs_in_force()
        old = await self._old_runs([run.id for run in runs])
        pruned = runs_to_prune(runs, self.settings.keep_runs, old, kept)
        going = [folder for run_id in pruned for folder in self.store.folders_of_run(run_id)]
        removed: list[Path] = await self.workers.run(_remove_pictures, going)
        if removed:
            log.info("%d pictures of old runs were removed", len(removed))
        latest = [self.store.folders_of_run(run.id) for run in runs[:SIZE_SAMPLE_RUNS]]
        self._run_bytes = await self.workers.run(_mean_bytes, latest)
        self.store.run_bytes = self._run_bytes or RUN_BYTES
        return removed

    def warnings(self) -> list[str]:
        """A warning when fewer than MIN_ROOM_RUNS more runs fit on the disk."""
        if not self._run_bytes or self.store.fault is not None:
            return []
        free = self.store.free_bytes() - self.settings.reserve_mb * 1e6
        room = max(0, int(free / self._run_bytes))
        if room >= MIN_ROOM_RUNS:
            return []
        return [Sentence("disk-few-runs", folder=str(self.store.folder), runs=room)]

    def families(self) -> Iterable[Metric]:
        return [
            Metric("handeyed_run_bytes", "gauge", "Mean size of the latest runs on the disk.", {(): self._run_bytes})
        ]

    async def _old_runs(self, runs: list[str]) -> set[str]:
        """Those of `runs`, newest first, that are older than keep_days by the daemon's working time."""
        now_s, folder = self.clock.monotonic_s(), self.store.folder
        before = await self.workers.run(read_ages, folder) if self._ages is None else self._ages
        elapsed_s = 0.0 if self._aged_s is None else now_s - self._aged_s
        ages = before.after(elapsed_s, runs[0] if runs else None)
        if ages != before:
            await self.store.write_file(folder / AGES_NAME, [ages.json()])
        self._ages, self._aged_s = ages, now_s
        return ages.older_than(self.settings.keep_days * 24 * 3600, runs)

    async def _runs(self) -> list[RunRecord]:
        runs: list[RunRecord] = []
        while page := await self.store.runs(PAGE, runs[-1].id if runs else None):
            runs += page
        return runs

    async def run(self) -> None:
        while True:
            try:
                await self.tidy()
            except StorageError as error:
                log.warning("old pictures could not be removed: %s", error)
            await asyncio.sleep(INTERVAL_S)


def _remove_pictures(folders: Iterable[Path]) -> list[Path]:
    """Delete the pictures and clouds in `folders`; session.json and the results stay."""
    removed = []
    for folder in folders:
        with storage_errors(folder):
            for picture in sorted(folder.glob("view_*")):
                picture.unlink(missing_ok=True)
                removed.append(picture)
    return removed


def _mean_bytes(runs: Sequence[Sequence[Path]]) -> float:
    """Of the runs that have a folder, with those of all their sensors."""
    sizes = [
        sum(file.stat().st_size for folder in folders for file in folder.glob("*"))
        for folders in runs
        if folders[0].is_dir()
    ]
    return sum(sizes) / len(sizes) if sizes else 0.0
