"""Keeps the drift chart of the active calibration up to date, for REST, PLC, metrics and alarms."""

import asyncio
import logging
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import datetime

from calibration.documents.calibration import CalibrationDocument
from calibration.errors import CalibrationError
from calibration.kinematics.robot_accuracy import NoiseBelief
from calibration.sentences.sentence import Sentence
from daemon.cell.arm_in_cell import ArmInCell
from daemon.config.settings import MAIN_CAMERA, Settings
from daemon.drift.chart import DriftChart, DriftReport, chart_of
from daemon.drift.samples import ChartEntry, VerificationHistory
from daemon.errors import CalibrationUnusable, DaemonError, NoCalibration, NotFound
from daemon.model.records import RunRecord
from daemon.runtime.clock import Clock
from daemon.runtime.event_bus import EventBus
from daemon.runtime.metrics import Metric
from daemon.runtime.shared_reading import SharedReading
from daemon.runtime.tasks import Service, end_task
from daemon.runtime.workers import Workers
from daemon.store.store import Store

log = logging.getLogger(__name__)

MAX_HISTORY = 10_000
"""Entries of the history of applied calibrations that are looked through for an earlier one."""


@dataclass(eq=False)
class DriftMonitor(Service):
    """Background service: recomputes the chart of one camera from the store after each verification."""

    settings: Settings
    store: Store
    events: EventBus
    workers: Workers
    clock: Clock
    arm: ArmInCell
    camera: str = MAIN_CAMERA
    chart: DriftChart = field(default_factory=DriftChart, init=False)
    _verifications: VerificationHistory = field(init=False)
    _task: asyncio.Task[None] | None = field(default=None, init=False)
    _turn: asyncio.Lock = field(default_factory=asyncio.Lock, init=False)
    _refreshed: SharedReading[None] = field(init=False)

    def __post_init__(self) -> None:
        self._refreshed = SharedReading(self._refresh)
        self._verifications = VerificationHistory(self.store, self.workers, self.settings.target)

    @property
    def report(self) -> DriftReport:
        return self.chart.report

    async def start(self) -> None:
        """Compute the chart without events, since the previous process has sent them, and follow new runs."""
        try:
            self.chart = await self._compute()
        except DaemonError as error:
            log.warning("the drift chart could not be read: %s", error)
        self._task = asyncio.create_task(self._listen(self.events.last), name="drift")

    async def stop(self) -> None:
        await end_task(self._task)

    def warnings(self) -> list[str]:
        """The alarm, for GET /ready."""
        return [self.report.alarm] if self.report.alarm else []

    def families(self) -> Iterator[Metric]:
        report, labels = self.report, () if self.camera == MAIN_CAMERA else (("camera", self.camera),)
        values = (
            (
                "alarm",
                "1 while the verifications say that the calibration no longer holds.",
                float(report.alarm is not None),
            ),
            ("verifications", "Verifications in the control chart.", float(report.verifications)),
            ("shift_meters", "How far the fixed target seems to have moved, averaged.", report.shift_mm / 1e3),
            ("limit_meters", "How far it may seem so by chance.", (report.limit_mm or 0.0) / 1e3),
            ("scatter_meters", "Scatter of the target over the positions, one axis.", report.scatter_mm / 1e3),
            (
                "verified_timestamp_seconds",
                "When the last verification was made, in seconds since 1970; 0: never.",
                datetime.fromisoformat(self.chart.points[-1].at).timestamp() if self.chart.points else 0.0,
            ),
        )
        for name, about, value in values:
            yield Metric(f"handeyed_drift_{name}", "gauge", about, {labels: value})

    async def refresh(self) -> DriftChart:
        """The chart with every finished run; those who ask at once share it. Raises StorageError."""
        await self._refreshed.read()
        return self.chart

    async def robot_noise(self) -> NoiseBelief | None:
        """By the active calibration and its verifications; None without one. Raises StorageError."""
        found = (await self.refresh()).robot_noise
        return None if found is None else found.belief()

    async def chart_of_earlier(self, calibration_id: str) -> DriftChart:
        """The chart of one that was active, from when it was first applied. Raises NotFound, StorageError."""
        document = (await self.store.calibration(calibration_id)).document
        applied = [row for row in await self.store.history(MAX_HISTORY) if row.calibration_id == calibration_id]
        if not applied or document.mount_T_camera is None:
            raise NotFound(Sentence("never-active", id=calibration_id), Sentence("see-what-was-active"))
        verifications = VerificationHistory(self.store, self.workers, self.settings.target)
        entries = await verifications.of(applied[-1], document)
        return await self._chart_of(entries, document)

    async def report_after(self, run: RunRecord) -> DriftReport:
        """The evaluation including this finished run; the previous one if the store fails."""
        with suppress(DaemonError):
            await self._refresh()
        return self.report

    async def _listen(self, after: int) -> None:
        async for event in self.events.listen(after):
            ended = event is not None and event.kind == "run" and event.data.get("state") in ("finished", "failed")
            if event is None or not (ended or event.kind == "applied"):
                continue
            try:
                await self._refresh()
            except DaemonError as error:
                log.warning("the drift chart could not be updated: %s", error)

    async def _refresh(self) -> None:
        """Recompute the chart; publish a changed evaluation and a raised or ended alarm, each once."""
        async with self._turn:
            before, self.chart = self.report, await self._compute()
            now = self.report
            if now == before:
                return
            self.events.publish("drift", {**now.event_data(), "camera": self.camera})
            if (now.alarm is None) == (before.alarm is None):
                return
            log.warning("%s", now.alarm or "drift: the alarm is over")
            alarm = {"kind": "drift", "raised": now.alarm is not None, "what": now.alarm or "it is over"}
            alarm |= {"calibration_id": now.calibration_id or before.calibration_id, "camera": self.camera}
            await self.store.outbox.post("alarm", self.clock.timestamp(), alarm)

    async def _compute(self) -> DriftChart:
        try:
            applied, record = await self.store.current(self.camera)
        except NoCalibration:
            return DriftChart()
        if record.document.mount_T_camera is None:
            return DriftChart(DriftReport(calibration_id=record.id))
        return await self._chart_of(await self._verifications.of(applied, record.document), record.document)

    async def _chart_of(self, entries: Sequence[ChartEntry], document: CalibrationDocument) -> DriftChart:
        """By the errors of the arm that were active with the calibration."""
        errors = await self.store.arm(document.id)
        try:
            used = (await self.workers.run(self.arm.in_use, document, errors)).document
        except (CalibrationError, CalibrationUnusable) as error:
            log.warning("drift is judged by the arm as drawn: %s", error)
            used = document
        return await self.workers.run(chart_of, entries, used, self.settings)
