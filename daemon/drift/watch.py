"""The chart of the calibration in force: entered after each verification, told to REST, PLC and metrics."""

import asyncio
import logging
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field

from calibration.documents.calibration import CalibrationDocument
from calibration.drift import DriftRules, DriftStanding, Entry, chart, scatter_limit_mm
from daemon.clock import Clock
from daemon.drift.samples import Verified, belongs, robot_noise_mm, verified
from daemon.errors import DaemonError, NoCalibration
from daemon.events import EventLog
from daemon.metrics import Metric
from daemon.settings import DriftSettings, Settings
from daemon.store.records import Applied, RunRecord
from daemon.store.store import Store
from daemon.workers import Workers

log = logging.getLogger(__name__)

MOST_RUNS = 1000
"""How far back the chart reaches: a year of verifications every eight hours."""

PAGE = 200

CALIBRATE = "calibrate before parts go wrong, see docs/plc.md; or look whether the target was moved"


@dataclass(frozen=True)
class DriftReport:
    """What the chart says now. `alarm` is a sentence, empty while the calibration holds.

    `shift_mm`: how far the fixed target seems to have moved, averaged; `limit_mm`: how far it may seem so by chance.
    """

    standing: DriftStanding | None = None
    calibration_id: str = ""
    verifications: int = 0
    shift_mm: float = 0.0
    limit_mm: float | None = None
    scatter_mm: float = 0.0
    scatter_limit_mm: float | None = None
    alarm: str = ""

    def told(self) -> dict[str, object]:
        """For an event."""
        return {**vars(self), "standing": self.standing.value if self.standing else None}


@dataclass(eq=False)
class DriftWatch:
    """Listens for verifications that end; an owner of nothing but what can be computed from the store again."""

    settings: Settings
    store: Store
    events: EventLog
    workers: Workers
    clock: Clock
    report: DriftReport = field(default_factory=DriftReport, init=False)
    _task: asyncio.Task[None] | None = field(default=None, init=False)
    _turn: asyncio.Lock = field(default_factory=asyncio.Lock, init=False)

    async def start(self) -> None:
        """What an earlier daemon has told is not told again."""
        try:
            self.report = await self._computed()
        except DaemonError as error:
            log.warning("the drift chart could not be read: %s", error)
        self._task = asyncio.create_task(self._listen(self.events.last), name="drift")

    async def stop(self) -> None:
        if self._task is not None:
            self._task.cancel()
            with suppress(asyncio.CancelledError):
                await self._task

    def warnings(self) -> list[str]:
        """For GET /ready."""
        return [self.report.alarm] if self.report.alarm else []

    def families(self) -> Iterator[Metric]:
        """For GET /metrics."""
        report = self.report
        told = (
            ("alarm", "1 while the verifications say that the calibration no longer holds.", float(bool(report.alarm))),
            ("verifications", "Verifications in the control chart.", float(report.verifications)),
            ("shift_meters", "How far the fixed target seems to have moved, averaged.", report.shift_mm / 1e3),
            ("limit_meters", "How far it may seem so by chance.", (report.limit_mm or 0.0) / 1e3),
            ("scatter_meters", "Scatter of the target over the positions, one axis.", report.scatter_mm / 1e3),
        )
        for name, about, value in told:
            yield Metric(f"handeyed_drift_{name}", "gauge", about, {(): value})

    async def entered(self, run: RunRecord) -> DriftReport:
        """The chart with this run in it, whoever noticed its end first."""
        with suppress(DaemonError):
            await self._renew()
        return self.report

    async def _listen(self, after: int) -> None:
        async for event in self.events.listen(after):
            ended = event is not None and event.kind == "run" and event.data.get("state") in ("finished", "failed")
            if event is None or not (ended or event.kind == "applied"):
                continue
            try:
                await self._renew()
            except DaemonError as error:
                log.warning("the drift chart could not be renewed: %s", error)

    async def _renew(self) -> None:
        """From the store; an alarm that is new, or gone, is told once, whoever noticed first."""
        async with self._turn:
            await self._told_anew()

    async def _told_anew(self) -> None:
        before, self.report = self.report, await self._computed()
        if self.report == before:
            return
        self.events.publish("drift", self.report.told())
        if bool(self.report.alarm) == bool(before.alarm):
            return
        log.warning("%s", self.report.alarm or "drift: the alarm is over")
        alarm = {"kind": "drift", "raised": bool(self.report.alarm), "what": self.report.alarm or "it is over"}
        calibration_id = self.report.calibration_id or before.calibration_id
        await self.store.outbox.post("alarm", self.clock.timestamp(), {**alarm, "calibration_id": calibration_id})

    async def _computed(self) -> DriftReport:
        try:
            applied, record = await self.store.current()
        except NoCalibration:
            return DriftReport()
        if record.document.flange_T_camera is None:
            return DriftReport(calibration_id=record.id)
        runs = await self._runs(applied)
        return await self.workers.run(report_of, runs, record.document, self.settings)

    async def _runs(self, applied: Applied) -> list[RunRecord]:
        """The chart's verifications, the oldest first."""
        found: list[RunRecord] = []
        before: str | None = None
        while len(found) < MOST_RUNS:
            page = await self.store.runs(PAGE, before)
            found += [run for run in page if belongs(run, applied)]
            if len(page) < PAGE or page[-1].created_at < applied.applied_at:
                break
            before = page[-1].id
        return found[MOST_RUNS - 1 :: -1]


def report_of(runs: list[RunRecord], document: CalibrationDocument, settings: Settings) -> DriftReport:
    """The chart of these verifications, the oldest first, and what it says at its end."""
    points = settings.target.target().points_mm
    entries = [verified(run, points) for run in runs]
    if not entries:
        return DriftReport(DriftStanding.LEARNING, document.id)
    rules = rules_of(settings.drift)
    last = chart([entry.sample for entry in entries], rules)[-1]
    limit_mm = _explained_mm(entries[-1], document, settings, rules)
    scatter_mm = entries[-1].sample.scatter_mm
    return DriftReport(
        last.standing,
        document.id,
        len(entries),
        round(last.drift_mm, 6),
        None if last.standing is DriftStanding.LEARNING else round(last.limit_mm, 6),
        round(scatter_mm, 6),
        None if limit_mm is None else round(limit_mm, 6),
        _alarm(last, scatter_mm, limit_mm),
    )


def rules_of(settings: DriftSettings) -> DriftRules:
    """As the mathematics wants them."""
    return DriftRules(settings.weight, settings.learn, settings.allowed_mm, settings.runs_between_false_alarms)


def _explained_mm(
    entry: Verified, document: CalibrationDocument, settings: Settings, rules: DriftRules
) -> float | None:
    """The largest scatter that the calibration's uncertainty and the robot's noise explain; None: not known."""
    if document.uncertainty is None or entry.sample.positions < 2:
        return None
    robot_mm = robot_noise_mm(document, settings.calibration)
    return scatter_limit_mm(document.uncertainty.point_mm, robot_mm, entry.sample.positions, rules.chance)


def _alarm(last: Entry, scatter_mm: float, limit_mm: float | None) -> str:
    if last.standing is DriftStanding.DRIFTING:
        return (
            f"drift: the fixed target seems to have moved by {last.drift_mm:.3f} mm, by chance at most"
            f" {last.limit_mm:.3f} mm: {CALIBRATE}"
        )
    if limit_mm is not None and scatter_mm > limit_mm:
        return (
            f"drift: the target scatters by {scatter_mm:.3f} mm over the positions, the calibration explains at most"
            f" {limit_mm:.3f} mm: {CALIBRATE}"
        )
    return ""
