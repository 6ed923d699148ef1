"""The verifications of the calibration in force, read from the store once each."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import takewhile

from calibration.transforms import Array
from daemon.drift.samples import Verified, belongs, verified
from daemon.model.records import Applied, RunRecord
from daemon.runtime.workers import Workers
from daemon.store.store import Store

MOST = 1000
"""How far back a chart reaches: a year of verifications every eight hours."""

PAGE = 20
"""Runs are large, verifications above all: a few are read at a time, and none of them kept."""


@dataclass(frozen=True)
class _Read:
    """What a run that was read says; nothing, when it does not belong to the chart."""

    run_id: str
    over: bool
    said: tuple[Verified, ...]


@dataclass(eq=False)
class Verifications:
    """Those of one calibration at a time."""

    store: Store
    workers: Workers
    target_points_mm: Array
    _applied: tuple[int, str] = (0, "")
    _kept: list[Verified] = field(default_factory=list)
    _last: str = ""
    """Up to this run everything is over, and kept."""

    async def of(self, applied: Applied) -> Sequence[Verified]:
        """The oldest first. Raises StorageError."""
        if self._applied != (applied.sequence, applied.calibration_id):
            self._applied, self._kept, self._last = (applied.sequence, applied.calibration_id), [], ""
        news = await self._news(applied)
        settled = list(takewhile(lambda read: read.over, news))
        if settled:
            self._last = settled[-1].run_id
        self._kept = [*self._kept, *(entry for read in settled for entry in read.said)][-MOST:]
        return [*self._kept, *(entry for read in news[len(settled) :] for entry in read.said)]

    async def _news(self, applied: Applied) -> list[_Read]:
        """Runs since the last one kept, the oldest first."""
        news: list[_Read] = []
        before: str | None = None
        while sum(len(read.said) for read in news) < MOST:
            page = await self.store.runs(PAGE, before)
            fresh = list(takewhile(lambda run: run.id != self._last, page))
            news += await self.workers.run(_read_all, fresh, applied, self.target_points_mm)
            if len(fresh) < PAGE or page[-1].created_at < applied.applied_at:
                break
            before = page[-1].id
        return news[::-1]


def _read_all(runs: list[RunRecord], applied: Applied, target_points_mm: Array) -> list[_Read]:
    return [
        _Read(
            run.id, run.over, (verified(run, target_points_mm),) if belongs(run, applied, len(target_points_mm)) else ()
        )
        for run in runs
    ]
