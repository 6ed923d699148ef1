"""Starts, supervises and aborts the one run in progress; after a restart it ends the interrupted one as failed."""

import asyncio
import logging
from collections import Counter
from collections.abc import Awaitable, Callable, Collection, Coroutine
from dataclasses import dataclass, replace
from typing import Any

from calibration.errors import CalibrationError, DetectionError, DocumentError, UndeterminedError
from calibration.sentences.sentence import Sentence, as_sentence
from daemon.cell.cell import Cell
from daemon.cell.safe_stop import MAX_ATTEMPT_S
from daemon.errors import (
    AbortHeld,
    CellBusy,
    DaemonError,
    NoCalibration,
    NotFound,
    NotWaiting,
    RunInProgress,
    RunOver,
    RunStalled,
    Stopping,
    StopUnconfirmed,
    StorageError,
)
from daemon.model.records import CauseDocument, RunKind, RunRecord
from daemon.model.run_states import RunState
from daemon.runs.calibrations import result_of, why_not_applied
from daemon.runs.operator_requests import OperatorRequestQueue
from daemon.runs.run_log import RunLog, RunResult, run_event
from daemon.runtime.clock import Clock
from daemon.runtime.event_bus import EventBus
from daemon.runtime.logs import about_run
from daemon.store.actor import current_audit_context
from daemon.store.damaged_rows import DamagedRow
from daemon.store.listings import NO_FILTERS, PageFilters
from daemon.store.store import Store
from drivers.errors import DeviceError, DeviceTimeout, DeviceUnreachable, LinkLost

LINK_ERRORS = (LinkLost, DeviceTimeout, DeviceUnreachable)


def progress_of(run: RunRecord) -> Sentence:
    """The progress of a run in words, such as "after picture 4 of 12": of all that it stores, a first look, too."""
    if run.pictures == 0:
        return Sentence("before-first-picture", of=run.stations)
    return Sentence("after-picture", picture=run.pictures, of=run.stations + run.pictures - run.station)


def cause_of(error: Exception, run: RunRecord) -> CauseDocument:
    progress = progress_of(run)
    match error:
        case DeviceError() if isinstance(error, LINK_ERRORS) and error.kind in (None, "robot"):
            code, what = "link-lost", Sentence("link-was-lost", progress=progress)
            fix: str = Sentence("check-link", why=as_sentence(error.what))
        case DeviceError():
            code, what, fix = error.code, end_words(f"{error.device}: {error.what}", progress), error.fix
        case DaemonError() | DetectionError() | UndeterminedError():
            code, what, fix = error.code, end_words(error.what, progress), error.fix
        case DocumentError():
            what = as_sentence("; ".join(str(problem) for problem in error.problems))
            code, fix = "document", Sentence("correct-and-run-again")
        case CalibrationError():
            code, what, fix = "calibration-error", end_words(str(error), progress), Sentence("look-at-stored")
        case _:
            said = as_sentence(f"{type(error).__name__}: {error}")
            code, what = "internal-error", Sentence("defect-ended-run", progress=progress, error=said)
            fix = Sentence("report-defect")
    return CauseDocument.because(code, what, fix)


def end_words(what: str, progress: Sentence) -> Sentence:
    """What ended a run, and how far it had come."""
    return Sentence("ended-at", what=as_sentence(what), progress=progress)


def abort_cause(by: str, run: RunRecord, warning: Sentence | None = None) -> CauseDocument:
    """The cause of a run that was aborted. `warning`: that the stop is not confirmed."""
    said = {"by": as_sentence(by), "progress": progress_of(run)}
    what = Sentence("run-was-aborted", **said)
    if warning is not None:
        what = Sentence("run-was-aborted-unconfirmed", **said, warning=warning)
    return CauseDocument.because("aborted", what, Sentence("start-when-ready"))


log = logging.getLogger(__name__)

MAX_STEP_S = 1800.0
"""A step that takes longer hangs: every driver has a limit of its own, the longest 10 minutes for a scanner."""

MAX_ABORT_S = MAX_ATTEMPT_S + 0.5
"""An abort is answered after this at the latest where the stop is not confirmed, whatever the run still waits for."""

Drive = Callable[[RunLog], Awaitable[RunResult]]


@dataclass(frozen=True)
class RunPlan:
    """How to start a run. `requests`: the queue of operator requests, for a manual run."""

    stations: int
    drive: Drive
    first_state: RunState = RunState.MOVING
    requests: OperatorRequestQueue | None = None


@dataclass
class _InProgress:
    log: RunLog
    task: asyncio.Task[None]
    requests: OperatorRequestQueue | None
    aborted_by: str = ""


class Supervisor:
    """Owns the run in progress."""

    def __init__(
        self,
        cell: Cell,
        store: Store,
        events: EventBus,
        clock: Clock,
        new_id: Callable[[Clock], str],
        update: Callable[[], str | None] = lambda: None,
    ) -> None:
        """`update`: the update that waits for the cell to be free, while there is one; no run begins then."""
        self._cell, self._store, self._events, self._clock, self._new_id = cell, store, events, clock, new_id
        self._update = update
        self._current: _InProgress | None = None
        self._starting = False
        self._stopping = False
        self._abort_holders: tuple[str, ...] = ()
        self.abort_holds = 0
        self._unsaved: dict[str, RunRecord] = {}
        self.end_counts: Counter[tuple[str, str]] = Counter()

    @property
    def in_progress(self) -> RunRecord | None:
        current = self._current
        return current.log.run if current and not current.log.run.is_over else None

    @property
    def latest(self) -> RunRecord | None:
        """The last run that was started since the daemon's start, as it stands; None when there was none."""
        return self._current.log.run if self._current else None

    def silent_s(self) -> float:
        """Seconds since the last step of the run in progress, for the watchdog."""
        return self._current.log.silent_s() if self._current else 0.0

    def hold_abort(self, holders: Collection[str]) -> None:
        """While `holders` is not empty nobody starts a run; one whose start is being prepared is not begun.

        `abort_holds` counts the calls with holders.
        """
        self._abort_holders = tuple(sorted(holders))
        self.abort_holds += bool(holders)

    @property
    def abort_is_held(self) -> bool:
        """True while a PLC holds abort."""
        return bool(self._abort_holders)

    def obstacles(self) -> tuple[str, ...]:
        """Reasons why nobody may start a run now, whatever the cell's state."""
        held = AbortHeld(self._abort_holders).reasons if self._abort_holders else ()
        update = self._update()
        return held if update is None else (*held, Sentence("update-holds", update=update))

    def require_no_abort(self) -> None:
        """Raises AbortHeld or Stopping when the arm may not begin to move now."""
        if self._stopping:
            raise Stopping
        if self._abort_holders:
            raise AbortHeld(self._abort_holders)

    def require_free(self) -> None:
        """Raises RunInProgress, CellBusy, AbortHeld or Stopping when a run could not start now."""
        self.require_no_abort()
        if (update := self._update()) is not None:
            raise Stopping(Sentence("update-holds", update=update))
        if (run := self.in_progress) is not None:
            raise RunInProgress(run.kind, run.id)
        if self._starting:
            raise CellBusy(Sentence("holder-run-prepared"))

    async def recover(self, is_auto: Callable[[str], bool]) -> list[RunRecord]:
        """End the runs that the previous process left unfinished; returns them.

        `is_auto`: whether the camera of that name has the policy "auto".
        """
        left = await self._store.runs_in_progress()
        for run in left:
            ended = await self._recover_run(run, is_auto)
            log.warning(
                "run %s: %s", run.id, ended.cause.what if ended.cause else "had finished before its end was stored"
            )
            try:
                await self._store.save_run(ended)
            except StorageError as error:
                self._unsaved[run.id] = ended
                log.error("this could not be stored: %s", error)
            self._events.publish("run", run_event(ended))
        return left

    async def _recover_run(self, run: RunRecord, is_auto: Callable[[str], bool]) -> RunRecord:
        """The final record of an interrupted run: finished if its calibration, stored last, exists; else failed.

        What policy "auto" left to a person is said as the run would have said it: the same is active as then.
        """
        now = self._clock.timestamp()
        try:
            found = await self._store.calibration(run.id)
        except NotFound:
            what = Sentence("daemon-ended-in-run", progress=progress_of(run))
            fix = Sentence("start-run-again", folder=str(self._store.run_folder(run.id)))
            cause = CauseDocument.because("interrupted", what, fix)
            return replace(run, state=RunState.FAILED, cause=cause, updated_at=now)
        try:
            in_force = (await self._store.current(found.camera))[1]
        except NoCalibration:
            in_force = None
        applied, why_not = in_force is not None and in_force.id == found.id, None
        if in_force is not None and not applied and found.accepted and is_auto(found.camera):
            why_not = why_not_applied(in_force.document, found.document)
        result = result_of(found.document, applied=applied, why_not=why_not)
        return replace(run, state=RunState.FINISHED, result=result, updated_at=now)

    async def start(
        self, kind: RunKind, request: dict[str, Any], prepare: Callable[[], Awaitable[RunPlan]]
    ) -> RunRecord:
        """Start the run that `prepare` plans; returns as soon as it is started.

        Raises RunInProgress at once when there is one, AbortHeld, Stopping, StorageError, and what `prepare` raises.
        """
        self.require_free()
        holds_before = self.abort_holds
        self._starting = True
        try:
            departure = await prepare()
            if self.abort_holds != holds_before:
                raise AbortHeld(self._abort_holders)
            now, first = self._clock.timestamp(), departure.first_state
            actor = current_audit_context()
            run = RunRecord(
                self._new_id(self._clock), kind, first, 0, departure.stations, now, now, request=request,
                started_by=actor.actor, started_by_role=actor.role,
            )  # fmt: skip
            run_log = RunLog(run, self._save, self._events, self._clock)
            await run_log.begin()
            if self._stopping:
                await run_log.fail(abort_cause(Sentence("by-stopping-daemon"), run), aborted=True)
                raise Stopping
            if self.abort_holds != holds_before:
                by = ", ".join(self._abort_holders) or Sentence("by-plc")
                await run_log.fail(abort_cause(by, run), aborted=True)
                raise AbortHeld(self._abort_holders)
            task = asyncio.create_task(self._supervise(run_log, departure.drive))
            self._current = _InProgress(run_log, task, departure.requests)
            await asyncio.sleep(0)  # a task that is cancelled before its first step would not record its end
        finally:
            self._starting = False
        return run

    def abort(self, run_id: str, by: str) -> Coroutine[Any, Any, RunRecord]:
        """Begin to end the run and to stop the arm, at once; awaited it gives the aborted run.

        When it returns, the controller has confirmed that the arm is stopped and disarmed. Raises StopUnconfirmed when
        that is not known MAX_ABORT_S later; the daemon then goes on trying. Raises RunOver, NotFound.
        """
        current = self._current
        if current is None or current.log.id != run_id or current.log.run.is_over:
            return self._refuse_abort(run_id)
        if not (current.log.concluding or current.aborted_by):  # a second cancellation would end its cleaning up
            current.aborted_by = by
            current.task.cancel()
            self._cell.stop_motion()
        return self._wait_for_abort(current)

    async def _refuse_abort(self, run_id: str) -> RunRecord:
        run = await self.run(run_id)
        self._require_stopped(run_id)
        raise RunOver(Sentence("run-is-over", run=run.id), Sentence("nothing-to-stop"))

    async def _wait_for_abort(self, current: _InProgress) -> RunRecord:
        await asyncio.wait([current.task], timeout=MAX_ABORT_S)
        if not current.task.done():
            self._require_stopped(current.log.id)
            await asyncio.wait([current.task])  # the arm stands; its end is being stored, or a result computed
        run = current.log.run
        self._require_stopped(run.id)
        if run.state is not RunState.ABORTED:
            raise RunOver(Sentence("run-ended-before-stop", run=run.id), Sentence("look-at-result"))
        return run

    def _require_stopped(self, run_id: str) -> None:
        """Raises StopUnconfirmed."""
        if (report := self._cell.safe_stop.unconfirmed) is not None:
            known = report.confirmed
            raise StopUnconfirmed(run_id, report.warning, stopped=known.standing, disarmed=known.disarmed)

    async def request_queue(self, run_id: str) -> OperatorRequestQueue:
        """The request queue of a manual run. Raises RunOver, NotWaiting, NotFound."""
        current = self._current
        if current is None or current.log.id != run_id or current.log.run.is_over:
            run = await self.run(run_id)
            raise RunOver(Sentence("run-is-over", run=run.id), Sentence("start-another-run"))
        if current.requests is None:
            raise NotWaiting(run_id)
        return current.requests

    async def run(self, run_id: str) -> RunRecord:
        """The latest record of a run. Raises NotFound."""
        current = self._current
        if current is not None and current.log.id == run_id:
            return current.log.run
        return self._unsaved.get(run_id) or await self._store.run(run_id)

    async def listings(
        self, limit: int, before: str | None, filters: PageFilters = NO_FILTERS
    ) -> list[RunRecord | DamagedRow]:
        """A page of runs, newest first; see Listings.runs."""
        page = await self._store.listings.runs(limit, before, filters)
        return [self._unsaved.get(found.id) or found for found in page]

    async def wait(self, run_id: str, seconds: float) -> RunRecord:
        """Wait for the end of the run up to `seconds`; returns its record then."""
        current = self._current
        if current is not None and current.log.id == run_id:
            await asyncio.wait([current.task], timeout=seconds)
        return await self.run(run_id)

    async def stop(self, by: str) -> None:
        """Refuse new runs, and abort the one in progress."""
        self._stopping = True
        if (run := self.in_progress) is not None:
            try:
                await self.abort(run.id, by)
            except RunOver:
                log.info("run %s ended by itself while the daemon was stopping", run.id)
            except StopUnconfirmed as error:
                log.error("%s", error)

    async def _supervise(self, run_log: RunLog, drive: Drive) -> None:
        with about_run(run_log.id):
            try:
                await run_log.finish(await _drive_with_limit(run_log, drive))
            except asyncio.CancelledError:
                by = self._current.aborted_by if self._current else ""
                report = self._cell.safe_stop.unconfirmed
                warning = None if report is None else report.warning
                cause = abort_cause(by or Sentence("by-stopping-daemon"), run_log.run, warning)
                await run_log.fail(cause, aborted=True)
            except Exception as error:
                cause = cause_of(error, run_log.run)
                if cause.code == "internal-error":
                    log.exception("a defect ended the run")
                else:
                    log.warning("the run failed: %s", error)
                await run_log.fail(cause)
        self.end_counts[run_log.run.kind, run_log.run.state] += 1
        if run_log.unsaved:
            self._unsaved[run_log.id] = run_log.run

    async def _save(self, run: RunRecord) -> None:
        """Save the run, after those that could not be saved earlier."""
        for run_id, record in list(self._unsaved.items()):
            await self._store.save_run(record)
            del self._unsaved[run_id]
        await self._store.save_run(run)


async def _drive_with_limit(run_log: RunLog, drive: Drive) -> RunResult:
    """Run `drive` with a limit of MAX_STEP_S for each step. Raises RunStalled, and the exceptions of `drive`."""
    loop = asyncio.get_running_loop()
    try:
        async with asyncio.timeout(None) as limit:

            def allow() -> None:
                endless = run_log.waits_for_operator or run_log.concluding
                if not limit.expired():
                    limit.reschedule(None if endless else loop.time() + MAX_STEP_S)

            run_log.at_each_step = allow
            allow()
            return await drive(run_log)
    except TimeoutError:
        if not limit.expired():
            raise
        what = Sentence("run-got-no-further", limit_s=MAX_STEP_S, state=str(run_log.run.state))
        raise RunStalled(what, Sentence("see-devices-answer")) from None
    finally:
        run_log.at_each_step = lambda: None
