"""Background jobs that register a scan and store its report; how far a job in a thread is, and how it is stopped.

A report belongs to a calibration and a set of views. After a new view it is outdated but not wrong: it describes the
earlier views until the next report replaces it.
"""

import asyncio
import logging
import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Literal

from calibration.documents.calibration import CalibrationDocument, FindingDocument
from calibration.documents.pose import PoseDocument
from calibration.documents.validation import Document, parse_document
from calibration.errors import DocumentError
from calibration.transforms import Array
from daemon.errors import NotFound, WorkersBusy
from daemon.runtime.clock import Clock
from daemon.runtime.event_bus import EventBus
from daemon.runtime.workers import Workers
from daemon.store.store import Store
from registration.documents import RegistrationReportDocument
from registration.fusion.concatenation import report_part, size_of
from registration.io.columns import common_layout
from registration.points.surface import limit_of
from registration.report import column_findings, report_of, unit_findings
from registration.scan import ScannerMount, ScanView, register_views, sample_views, scanner_mount_of

STEP, INTERVAL_S = 0.05, 1.0
"""Least increase and least time between two reports: twenty at the most of one job, none of one below a second."""


class ProgressReports:
    """Takes the share of a job that is done, 0 to 1, in its thread; calls `report` in the event loop with some of them.

    The shares reported increase. Made in the event loop.
    """

    def __init__(self, report: Callable[[float], None], monotonic_s: Callable[[], float]) -> None:
        self._report, self._monotonic_s = report, monotonic_s
        self._loop = asyncio.get_running_loop()
        self._share, self._at_s = 0.0, monotonic_s()

    def __call__(self, share: float) -> None:
        now_s = self._monotonic_s()
        if share >= self._share + STEP and now_s >= self._at_s + INTERVAL_S:
            self._share, self._at_s = share, now_s
            self._loop.call_soon_threadsafe(self._report, share)


class StepEnd:
    """Whether `stop` is set, asked by a job in a thread after each step. During a run it rests for as long first.

    A lower priority is no substitute: a thread of little that holds Python's lock keeps everybody waiting.
    """

    def __init__(
        self, stop: threading.Event, run_in_progress: Callable[[], bool], monotonic_s: Callable[[], float]
    ) -> None:
        self._stop, self._run_in_progress, self._monotonic_s = stop, run_in_progress, monotonic_s
        self._at_s = math.inf

    def __call__(self) -> bool:
        """The first call, as the job begins, does not rest."""
        if self._run_in_progress() and (worked_s := self._monotonic_s() - self._at_s) > 0:
            self._stop.wait(worked_s)
        self._at_s = self._monotonic_s()
        return self._stop.is_set()


log = logging.getLogger(__name__)


class StoredRegistration(Document):
    schema_version: Literal[1] = 1
    refined: bool
    flange_T_scanner: PoseDocument
    report: RegistrationReportDocument


@dataclass(frozen=True, eq=False)
class RegistrationRequest:
    """The inputs of a registration. `findings`: on its poses, for the report."""

    scan_id: str
    views: Sequence[ScanView]
    calibration: CalibrationDocument
    flange_T_scanner: Array
    refine: bool
    findings: tuple[FindingDocument, ...] = ()

    @property
    def key(self) -> tuple[str, int, str, bool]:
        return self.scan_id, len(self.views), self.calibration.id, self.refine

    def matches(self, stored: StoredRegistration) -> bool:
        """True when a stored report has the same views, calibration, scanner and refinement."""
        same_hand = stored.flange_T_scanner == PoseDocument.of(self.flange_T_scanner)
        report = stored.report
        same_work = (report.calibration_id, len(report.views)) == (self.calibration.id, len(self.views))
        return same_hand and same_work and stored.refined == self.refine


@dataclass
class _Job:
    """A job in progress: its state and the views read, and the share of all that is done."""

    task: asyncio.Task[RegistrationReportDocument]
    stage: tuple[str, int] = ("reading", 0)
    progress: float = 0.0


OnStage = Callable[[str, int, float], None]

READING, READING_TO_REFINE = 0.9, 0.6
"""Share of a job that is done when every view is read, without and with a refinement."""


@dataclass(eq=False)
class RegistrationJobs:
    """The registrations in progress; equal requests share one job. `workers`: those of merges and registrations."""

    store: Store
    workers: Workers
    clock: Clock
    events: EventBus
    _jobs: dict[tuple[str, int, str, bool], _Job] = field(default_factory=dict, init=False)

    def start(
        self, wanted: RegistrationRequest, *, only_if_free: bool = True
    ) -> "asyncio.Task[RegistrationReportDocument]":
        """The job for this request, started if necessary; it continues when no caller waits for it.

        `only_if_free`: it ends with WorkersBusy when it would have to be computed and too many jobs wait.
        """
        job = self._jobs.get(wanted.key)
        if job is None:
            job = self._jobs[wanted.key] = _Job(asyncio.create_task(self._run_job(wanted, only_if_free)))
            job.task.add_done_callback(lambda done: self._finish_job(wanted, done))
        return job.task

    def progress_of(self, task: "asyncio.Task[RegistrationReportDocument]") -> float:
        """The share of a job that is done, 0 to 1."""
        return next((job.progress for job in self._jobs.values() if job.task is task), 1.0)

    async def find_report(self, wanted: RegistrationRequest) -> RegistrationReportDocument | None:
        """The stored report if it matches this request, else None."""
        file = self._file(wanted)
        try:
            found = parse_document(StoredRegistration, await self.store.read_file(file), str(file))
        except NotFound:
            return None
        except DocumentError as error:
            log.warning("a stored report cannot be used and is made anew: %s", error)
            return None
        return found.report if wanted.matches(found) else None

    def stop(self) -> None:
        for job in self._jobs.values():
            job.task.cancel()

    async def _run_job(self, wanted: RegistrationRequest, only_if_free: bool) -> RegistrationReportDocument:
        earlier = await self.find_report(wanted)
        if earlier is not None:
            return earlier
        loop = asyncio.get_running_loop()

        def on_stage(state: str, views_read: int, progress: float) -> None:
            loop.call_soon_threadsafe(self._publish_stage, wanted, (state, views_read), progress)

        on_progress = ProgressReports(partial(self._publish_stage, wanted, None), self.clock.monotonic_s)
        run = self.workers.run_if_free if only_if_free else self.workers.run
        report = await run(_register, wanted, self.clock.monotonic_s, on_stage, on_progress)
        document = StoredRegistration(
            refined=wanted.refine, flange_T_scanner=PoseDocument.of(wanted.flange_T_scanner), report=report
        )
        await self.store.write_file(self._file(wanted), [document.model_dump_json(indent=1).encode()])
        return report

    def _finish_job(self, wanted: RegistrationRequest, job: "asyncio.Task[RegistrationReportDocument]") -> None:
        del self._jobs[wanted.key]
        if job.cancelled():
            return
        error = job.exception()
        if isinstance(error, WorkersBusy):
            return
        if error is None:
            self._publish(wanted, "finished", {"rms_mm": job.result().rms_mm.model_dump(), "progress": 1.0})
        else:
            log.warning("scan %s could not be registered: %s", wanted.scan_id, error)
            self._publish(wanted, "failed", {"cause": str(error)})

    def _publish_stage(self, wanted: RegistrationRequest, stage: tuple[str, int] | None, progress: float) -> None:
        """Publish a new stage, its state and the views read, or how far the present one is."""
        job = self._jobs.get(wanted.key)
        if job is None:  # the daemon stops, and its thread is not done yet
            return
        job.stage, job.progress = stage or job.stage, progress
        state, views_read = job.stage
        self._publish(wanted, state, {"views_read": views_read, "progress": round(progress, 3)})

    def _publish(self, wanted: RegistrationRequest, state: str, more: dict[str, Any]) -> None:
        about = {"scan_id": wanted.scan_id, "calibration_id": wanted.calibration.id, "refine": wanted.refine}
        self.events.publish("registration", {**about, "state": state, "views": len(wanted.views), **more})

    def _file(self, wanted: RegistrationRequest) -> Path:
        name = "refined.json" if wanted.refine else "registered.json"
        return self.store.scan_folder(wanted.scan_id) / name


def _register(
    wanted: RegistrationRequest, clock: Callable[[], float], on_stage: OnStage, on_progress: Callable[[float], None]
) -> RegistrationReportDocument:
    """Register the views and return the report; writes nothing. Raises RegistrationError.

    `on_stage` is called when a view is read and when they are registered, with the state, the views read and the share
    of all that is done; `on_progress` between them, with the share alone.
    """
    began, samples, done = clock(), [], 0.0
    reading = READING_TO_REFINE if wanted.refine else READING
    whole = max(sum(size_of(view.path) for view in wanted.views), 1)
    limit = limit_of(len(wanted.views), refine=wanted.refine)
    for count, view in enumerate(wanted.views):
        on_stage("reading", count, done)
        share = reading * size_of(view.path) / whole
        samples += sample_views([view], partial(report_part, on_progress, done, share), limit=limit)
        done += share
    on_stage("registering", len(samples), reading)
    read = clock()
    given = scanner_mount_of(wanted.calibration)
    hand = ScannerMount(given.calibration_id, wanted.flange_T_scanner, given.noise)
    rest = partial(report_part, on_progress, reading, 1 - reading)
    registration = register_views(wanted.views, samples, hand, refine=wanted.refine, on_progress=rest)
    _, lost = common_layout(sample.layout for sample in samples)
    points = sum(view.points - view.non_finite for view in registration.views)
    seconds = {"read": read - began, "register": clock() - read, "write": 0.0}
    findings = [*wanted.findings, *unit_findings(samples), *column_findings(lost)]
    return report_of(registration, hand, points, seconds, findings)  # type: ignore[arg-type]
