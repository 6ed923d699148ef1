"""Raw pictures are kept for so many runs and so long; and a full disk is foreseen while there is still room."""

import asyncio
import logging
import shutil
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path

from daemon.config.settings import StorageSettings
from daemon.errors import NoCalibration, StorageError
from daemon.model.records import RunRecord
from daemon.runtime.clock import Clock
from daemon.runtime.metrics import Metric
from daemon.runtime.workers import Workers
from daemon.store.database import storage_errors
from daemon.store.store import Store

log = logging.getLogger(__name__)

EVERY_S = 3600.0
PAGE = 500
SAMPLE = 10
"""So many of the latest runs tell how much room the next one takes."""

ROOM_WORTH_A_WARNING = 100
"""Runs that still fit: at one an hour, four days to do something about it."""


def outlived(runs: Sequence[RunRecord], keep_runs: int, keep_days: float, kept: frozenset[str]) -> list[str]:
    """Ids of the runs whose pictures go; `runs` newest first.

    Age is counted back from the newest run, not from the clock: one that is set wrong must not empty the disk.
    """
    if not runs:
        return []
    oldest = _time(runs[0].created_at) - timedelta(days=keep_days)
    return [
        run.id
        for place, run in enumerate(runs)
        if place > 0 and run.over and run.id not in kept and (place >= keep_runs or _time(run.created_at) < oldest)
    ]


def _time(timestamp: str) -> datetime:
    return datetime.fromisoformat(timestamp)


@dataclass(eq=False)
class Retention:
    """A companion of the daemon: it tidies up when the daemon starts, and every hour."""

    store: Store
    workers: Workers
    clock: Clock
    settings: StorageSettings
    _run_bytes: float = field(default=0.0, init=False)
    _task: asyncio.Task[None] | None = field(default=None, init=False)

    async def start(self) -> None:
        self._task = asyncio.create_task(self._tidy_for_ever())

    async def stop(self) -> None:
        if self._task is not None:
            self._task.cancel()
            with suppress(asyncio.CancelledError):
                await self._task

    async def tidy(self) -> list[Path]:
        """The pictures that were removed. Raises StorageError."""
        runs = await self._runs()
        try:
            _, current = await self.store.current()
            kept = frozenset(filter(None, (current.run_id,)))
        except NoCalibration:
            kept = frozenset()
        going = [self.store.run_folder(run_id) for run_id in outlived(
            runs, self.settings.keep_runs, self.settings.keep_days, kept)]  # fmt: skip
        removed: list[Path] = await self.workers.run(_remove_pictures, going)
        if removed:
            log.info("%d pictures of runs long ago were removed", len(removed))
        latest = [self.store.run_folder(run.id) for run in runs[:SAMPLE]]
        self._run_bytes = await self.workers.run(_mean_bytes, latest)
        return removed

    def warnings(self) -> list[str]:
        """How many more runs fit, when they are few."""
        if not self._run_bytes:
            return []
        free = shutil.disk_usage(self.store.folder).free - self.settings.reserve_mb * 1e6
        room = max(0, int(free / self._run_bytes))
        if room >= ROOM_WORTH_A_WARNING:
            return []
        return [f"the disk of {self.store.folder} has room for about {room} more runs: free some, or lower keep_runs"]

    def families(self) -> Iterable[Metric]:
        return [Metric("handeyed_run_bytes", "gauge", "What a run takes on the disk, lately.", {(): self._run_bytes})]

    async def _runs(self) -> list[RunRecord]:
        runs: list[RunRecord] = []
        while page := await self.store.runs(PAGE, runs[-1].id if runs else None):
            runs += page
        return runs

    async def _tidy_for_ever(self) -> None:
        while True:
            try:
                await self.tidy()
            except StorageError as error:
                log.warning("old pictures could not be removed: %s", error)
            await asyncio.sleep(EVERY_S)


def _remove_pictures(folders: Iterable[Path]) -> list[Path]:
    """session.json and what was found stay."""
    removed = []
    for folder in folders:
        with storage_errors(folder):
            for picture in sorted(folder.glob("view_*.png")):
                picture.unlink(missing_ok=True)
                removed.append(picture)
    return removed


def _mean_bytes(folders: Sequence[Path]) -> float:
    sizes = [sum(file.stat().st_size for file in folder.glob("*")) for folder in folders if folder.is_dir()]
    return sum(sizes) / len(sizes) if sizes else 0.0
