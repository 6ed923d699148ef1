"""The persistent store of runs, calibrations and scans. Every write is on the disk when its call returns.

Documents are parsed in the database's thread: twenty verifications would keep the event loop for 20 ms.
"""

import asyncio
import json
import logging
import shutil
import sqlite3
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from calibration.documents.arm import ArmErrorsDocument
from calibration.documents.calibration import AccuracyDocument, CalibrationDocument
from calibration.sentences.sentence import Sentence
from daemon.config.settings import MAIN_CAMERA
from daemon.errors import AppliedMeanwhile, NoCalibration, NotFound, Noun, StorageFull, StorageInconsistent
from daemon.model.records import (
    AppliedCalibration,
    CalibrationRecord,
    CauseDocument,
    FlangePose,
    RunRecord,
    ScanRecord,
    ScanViewDocument,
    Unit,
)
from daemon.model.run_states import FINAL_STATES, RunState
from daemon.runtime.durable_files import WriteFile, rename_durably, write_durably
from daemon.runtime.event_bus import MAX_EVENTS, BusEvent, Publish
from daemon.runtime.failpoints import NO_FAILPOINTS, Failpoints
from daemon.store.access_keys import AccessKeys
from daemon.store.actor import current_audit_context, record_change
from daemon.store.audit_log import AuditLog
from daemon.store.consistency import StoreFault, find_fault
from daemon.store.damaged_rows import Parsed, parse_each, parse_row, parse_stored, parsing, split_damaged
from daemon.store.database import Database
from daemon.store.documents import ACCEPTANCES, DocumentKind, DocumentRecord, Documents
from daemon.store.idempotency_keys import IdempotencyKeys
from daemon.store.listings import ACCURACY, APPLIED, RUNS, SCAN_VIEWS, SCANS, Listings, read_page, views_of
from daemon.store.opening import LockedStore
from daemon.store.outbox import Outbox
from daemon.store.sign_in import BrowserSessions


def read_calibration(row: tuple[Any, ...]) -> CalibrationRecord:
    """The record of a row. Raises StorageInconsistent when its document is not what was stored."""
    calibration_id, run_id, created_at, accepted, content, camera = row
    document = parse_stored(CalibrationDocument, content, f"calibration {calibration_id}")
    return CalibrationRecord(calibration_id, run_id, created_at, bool(accepted), document, camera)


def read_applied(row: Any) -> AppliedCalibration:
    """The entry of a row of the history. Raises StorageInconsistent."""
    return parse_row(APPLIED.record, row, "applied calibration")


def read_run_or_failed(row: Any) -> RunRecord:
    """The record of a row; of a damaged one only id and times, failed."""
    try:
        return parse_row(RUNS.record, row, "run")
    except StorageInconsistent as error:
        cause = CauseDocument.because(error.code, error.what, error.fix)
        run_id, kind, _state, _station, _stations, created_at, updated_at, *_ = row
        return RunRecord(str(run_id), kind, RunState.FAILED, 0, 0, str(created_at), str(updated_at), cause)


class StoredEvents:
    """The EventStore of the event bus."""

    def __init__(self, database: Database) -> None:
        self._database = database

    async def last(self) -> list[BusEvent]:
        """The last MAX_EVENTS events, oldest first, without those that a damaged database holds no text of."""
        rows = await self._database.read(
            lambda db: db.execute("SELECT number, kind, data FROM events ORDER BY number").fetchall()
        )
        return [BusEvent(number, kind, json.loads(data)) for number, kind, data in rows[-MAX_EVENTS:] if data]

    async def keep(self, events: Sequence[BusEvent]) -> None:
        """Store the events in one transaction and drop old ones. Raises StorageError."""
        rows = [(event.number, event.kind, json.dumps(event.data)) for event in events]
        oldest = rows[-1][0] - 2 * MAX_EVENTS

        def insert(db: sqlite3.Connection) -> None:
            db.executemany("INSERT INTO events VALUES (?, ?, ?)", rows)
            db.execute("DELETE FROM events WHERE number <= ?", (oldest,))

        await self._database.write(insert)


log = logging.getLogger(__name__)

_CALIBRATION = "SELECT id, run_id, created_at, accepted, document, camera FROM calibrations"

RUN_BYTES = 20e6
"""What a run takes on the disk, until the sizes of the latest runs are known."""


class Store:
    """SQLite, and large files beside it in the folders runs/ID/ and scans/ID/, which the command line reads too.

    `publish` is called after a calibration was stored or applied, a view of a scan, or a document was stored.
    """

    def __init__(self, folder: Path, write_file: WriteFile | None = None, at: Failpoints = NO_FAILPOINTS) -> None:
        """Open or create the store in `folder` and lock it. A store with a fault is opened for reading only.

        Raises StorageError, StorageTooNew, StorageInUse.
        """
        self.folder = folder
        self._write_file = write_file or partial(write_durably, at=at)
        self._at = at
        self._opened = LockedStore(folder, at)
        self._database = self._opened.database
        self.run_bytes = RUN_BYTES
        self.publish: Publish = lambda kind, data: None
        self.idempotency_keys = IdempotencyKeys(self._database)
        self.stored_events = StoredEvents(self._database)
        self.outbox = Outbox(self._database)
        self.access_keys = AccessKeys(self._database, self._opened.key_reader)
        self.browser_sessions = BrowserSessions(self._database, self._opened.key_reader)
        self.audit = AuditLog(self._database)
        self.listings = Listings(self._opened.list_reader)
        self.acceptances = self.documents(ACCEPTANCES)

    def documents(self, kind: DocumentKind) -> Documents:
        publish = lambda *event: self.publish(*event)  # noqa: E731, PLW0108 # it is set after the store is made
        return Documents(kind, self._database, self._opened.list_reader, publish)

    async def close(self) -> None:
        await asyncio.to_thread(self._opened.close)

    @property
    def fault(self) -> StoreFault | None:
        """Why nothing is written and no run is started; None while the store is sound."""
        return self._opened.guard.find_fault()

    async def check(self, *, whole: bool = False) -> StoreFault | None:
        """Look for faults: at the end of the audit log, or with `whole` at every page and row.

        A fault that was found stays until the store is opened again. Raises StorageError.
        """
        guard = self._opened.guard
        if (fault := guard.find_fault()) is None:
            guard.fault = await (
                asyncio.to_thread(find_fault, self._database.path) if whole else self.audit.find_fault()
            )
            fault = guard.fault
        return fault

    def obstacles(self) -> tuple[str, ...]:
        """Why no run can be stored now: a fault, or too little space on the disk."""
        if (fault := self.fault) is not None:
            return (fault.what,)
        return () if self.free_bytes() >= self.run_bytes else (self._full(),)

    async def require_ready(self) -> None:
        """Before a run. Raises StorageInconsistent, or StorageFull when it does not fit on the disk."""
        if (fault := await self.check()) is not None:
            raise StorageInconsistent(fault.what, fault.fix)
        if self.free_bytes() < self.run_bytes:
            raise StorageFull(self._full(), Sentence("free-or-keep-fewer"))

    def free_bytes(self) -> int:
        """Free space on the store's disk; 0 when the folder is not there."""
        try:
            return shutil.disk_usage(self.folder).free
        except OSError:
            return 0

    def _full(self) -> Sentence:
        return Sentence("no-room-for-run", folder=str(self.folder), mb=self.run_bytes / 1e6)

    async def _find(self, query: str, value: int | str, parse: Callable[[Any], Parsed]) -> Parsed | None:
        """The first row of which that is true, parsed in the database's thread; None without one."""

        def read(db: sqlite3.Connection) -> Parsed | None:
            row = db.execute(query, (value,)).fetchone()
            return None if row is None else parse(row)

        return await self._database.read(read)

    async def _get(self, noun: Noun, select: str, row_id: str, parse: Callable[[Any], Parsed]) -> Parsed:
        """The row with this id. Raises NotFound."""
        found = await self._find(f"{select} WHERE id = ?", row_id, parse)
        if found is None:
            raise NotFound.noun(noun, row_id)
        return found

    # runs

    def run_folder(self, run_id: str) -> Path:
        return self.folder / "runs" / run_id

    def folder_beside(self, run_id: str, sensor: str) -> Path:
        """The session of a further sensor of a run."""
        return self.run_folder(f"{run_id}-{sensor}")

    def session_folder(self, run_id: str, camera: str) -> Path:
        """The session of that camera in a run: its own where it was a further one, else the run's."""
        beside = self.folder_beside(run_id, camera)
        return beside if beside.is_dir() else self.run_folder(run_id)

    def folders_of_run(self, run_id: str) -> list[Path]:
        """The folders of all sessions of a run."""
        return [self.run_folder(run_id), *sorted(self.run_folder(run_id).parent.glob(f"{run_id}-*"))]

    async def save_run(self, run: RunRecord) -> None:
        """Insert or update the run."""
        context = current_audit_context()

        def save(db: sqlite3.Connection) -> None:
            if not RUNS.update(db, run):
                RUNS.insert(db, run)
                record_change(db, context, run.created_at, "run", run.id, kind=run.kind)

        await self._database.write(save)

    async def run(self, run_id: str) -> RunRecord:
        """The run with this id. Raises NotFound."""
        return await self._get("run", RUNS.select, run_id, lambda row: parse_row(RUNS.record, row, "run"))

    async def runs(self, limit: int, before: str | None = None) -> list[RunRecord]:
        """Up to `limit` runs older than the one with the id `before`, newest first. Raises CursorUnknown.

        One that is damaged is there as a failed one without request and result.
        """
        return await self._database.read(
            lambda db: [read_run_or_failed(row) for row in read_page(db, RUNS.select, "runs", limit, before)]
        )

    async def runs_in_progress(self) -> list[RunRecord]:
        """Runs in no final state, which an earlier daemon left so; without damaged ones, which nobody could end."""
        states = tuple(str(state) for state in sorted(FINAL_STATES))
        marks = ", ".join("?" * len(states))
        query = f"{RUNS.select} WHERE state NOT IN ({marks})"
        rows = await self._database.read(lambda db: parse_each(RUNS.record, db.execute(query, states)))
        found, damaged = split_damaged(rows)
        for run_id in damaged:
            log.error("run %s in the store is damaged; it is left as it is", run_id)
        return found

    # calibrations

    async def save_calibration(self, calibration: CalibrationRecord, arm: ArmErrorsDocument | None = None) -> None:
        """Insert a calibration, and the arm's errors identified with it. Calibrations are never changed."""
        row = (calibration.id, calibration.run_id, calibration.created_at, calibration.accepted,
               calibration.document.model_dump_json(), calibration.camera)  # fmt: skip

        def insert(db: sqlite3.Connection) -> None:
            db.execute("INSERT INTO calibrations VALUES (?, ?, ?, ?, ?, ?)", row)
            if arm is not None:
                db.execute("INSERT INTO arms VALUES (?, ?)", (calibration.id, arm.model_dump_json()))

        await self._database.write(insert)
        self.publish("calibration", {"calibration_id": calibration.id, "run_id": calibration.run_id,
                                     "accepted": calibration.accepted, "at": calibration.created_at,
                                     "camera": calibration.camera,
                                     **calibration.document.accuracy.fields()})  # fmt: skip

    async def calibration(self, calibration_id: str) -> CalibrationRecord:
        """The calibration with this id. Raises NotFound."""
        return await self._get("calibration", _CALIBRATION, calibration_id, read_calibration)

    async def arm(self, calibration_id: str) -> ArmErrorsDocument | None:
        """The arm's errors identified with a calibration; None where they were not. Raises StorageInconsistent."""
        query, name = "SELECT document FROM arms WHERE calibration_id = ?", f"arm.json of calibration {calibration_id}"
        return await self._find(query, calibration_id, lambda row: parse_stored(ArmErrorsDocument, row[0], name))

    async def apply(self, applied: AppliedCalibration, expected: Sequence[int] | None = None) -> AppliedCalibration:
        """Put an active calibration by appending it to the history; returns it with its sequence number.

        `expected`: sequence numbers of which one must be active for that camera now (0: none ever was). Raises
        AppliedMeanwhile.
        """
        context = current_audit_context()

        def insert(db: sqlite3.Connection) -> tuple[int, str | None]:
            query = "SELECT coalesce(max(sequence), 0) FROM applied WHERE camera = ?"
            (now,) = db.execute(query, (applied.camera,)).fetchone()
            if expected is not None and now not in expected:
                raise AppliedMeanwhile(now)
            APPLIED.insert(db, applied, role=context.role, sequence=None)  # which the table assigns
            (sequence,) = db.execute("SELECT last_insert_rowid()").fetchone()
            despite = {"despite_verdict": True, "reason": applied.reason} if applied.despite_verdict else {}
            record_change(db, context, applied.applied_at, "apply", str(sequence), calibration=applied.calibration_id,
                 by=applied.applied_by, **despite)  # fmt: skip
            query = f"SELECT {ACCURACY} FROM calibrations WHERE id = ?"
            (accuracy,) = db.execute(query, (applied.calibration_id,)).fetchone()
            return int(sequence), accuracy

        sequence, accuracy = await self._database.write(insert)
        stored = replace(applied, sequence=sequence, role=context.role)
        self.publish("applied", {"calibration_id": stored.calibration_id, "applied_by": stored.applied_by,
                                 "role": stored.role, "sequence": stored.sequence, "at": stored.applied_at,
                                 "camera": stored.camera,
                                 **AccuracyDocument.model_validate_json(accuracy or "{}").fields()})  # fmt: skip
        return stored

    async def history(self, limit: int = 1) -> list[AppliedCalibration]:
        """The applied calibrations of all cameras, newest first: the first one of each camera is active."""
        query = f"{APPLIED.select} ORDER BY sequence DESC LIMIT ?"
        return await self._database.read(lambda db: [read_applied(row) for row in db.execute(query, (limit,))])

    async def history_entry(self, sequence: int) -> AppliedCalibration:
        """The entry of the history with this sequence number. Raises NotFound."""
        found = await self._find(f"{APPLIED.select} WHERE sequence = ?", sequence, read_applied)
        if found is None:
            raise NotFound(Sentence("no-such-entry", number=sequence), Sentence("see-what-was-active"))
        return found

    async def last_run_before(self, sequence: int) -> str:
        """The id of the run begun last before that entry of the history, by the audit log's order; "" without one."""
        query = """SELECT subject FROM audit WHERE action = 'run' AND sequence < (
            SELECT sequence FROM audit WHERE action = 'apply' AND subject = ?) ORDER BY sequence DESC LIMIT 1"""
        found = await self._database.read(lambda db: db.execute(query, (str(sequence),)).fetchone())
        return found[0] if found else ""

    async def current(self, camera: str = MAIN_CAMERA) -> tuple[AppliedCalibration, CalibrationRecord]:
        """The active calibration of a camera and its entry in the history. Raises NoCalibration."""

        def read(db: sqlite3.Connection) -> tuple[AppliedCalibration, CalibrationRecord]:
            query = f"{APPLIED.select} WHERE camera = ? ORDER BY sequence DESC LIMIT 1"
            row = db.execute(query, (camera,)).fetchone()
            if row is None:
                raise NoCalibration(camera)
            applied = read_applied(row)
            found = db.execute(f"{_CALIBRATION} WHERE id = ?", (applied.calibration_id,)).fetchone()
            if found is None:
                raise NotFound.noun("calibration", applied.calibration_id)
            return applied, read_calibration(found)

        return await self._database.read(read)

    async def runs_in_force(self) -> frozenset[str]:
        """The runs that the active calibrations of all cameras come from."""
        query = """SELECT run_id FROM calibrations WHERE run_id IS NOT NULL AND id IN (
            SELECT calibration_id FROM applied WHERE sequence IN (SELECT max(sequence) FROM applied GROUP BY camera))"""
        return frozenset(run_id for (run_id,) in await self._database.read(lambda db: db.execute(query).fetchall()))

    # scans

    def scan_folder(self, scan_id: str) -> Path:
        return self.folder / "scans" / scan_id

    async def save_scan(self, scan: ScanRecord) -> None:
        context = current_audit_context()

        def insert(db: sqlite3.Connection) -> None:
            SCANS.insert(db, scan)
            record_change(db, context, scan.created_at, "scan", scan.id, name=scan.name)

        await self._database.write(insert)
        self.publish("scan", {"scan_id": scan.id, "at": scan.created_at})

    async def scan(self, scan_id: str) -> ScanRecord:
        """The scan with this id. Raises NotFound."""
        return await self._get("scan", SCANS.select, scan_id, lambda row: parse_row(SCANS.record, row, "scan"))

    async def acceptances_of(self, scanner: str, limit: int) -> list[DocumentRecord]:
        """The latest verifications of a scanner by name, at most `limit`, the oldest first. Raises StorageError."""
        query = """SELECT a.id, a.scan_id, a.created_at, a.created_by, a.document FROM acceptances a
            JOIN scans s ON s.id = a.scan_id WHERE s.scanner = ? ORDER BY a.rowid DESC LIMIT ?"""
        rows = await self._database.read(lambda db: db.execute(query, (scanner, limit)).fetchall())
        return [DocumentRecord(*row) for row in rows[::-1]]

    async def add_scan_view(
        self, scan_id: str, upload: Path, unit: Unit, pose: FlangePose, created_at: str, *, points: int
    ) -> ScanViewDocument:
        """Append the uploaded file to the scan as its next view; the file is on the disk before its row."""
        context = current_audit_context()

        def insert(db: sqlite3.Connection) -> ScanViewDocument:
            count = db.execute("SELECT COUNT(*) FROM scan_views WHERE scan_id = ?", (scan_id,)).fetchone()[0]
            file = f"view_{count:03d}{upload.suffix}"
            view = ScanViewDocument(
                **vars(pose), view=count, file=file, unit=unit, created_at=created_at, points=points,
                bytes=upload.stat().st_size, created_by=context.actor,
            )  # fmt: skip
            rename_durably(upload, upload.with_name(view.file), self._at)
            SCAN_VIEWS.insert(db, view, scan_id=scan_id)
            record_change(db, context, created_at, "view", f"{scan_id} {view.view}")
            return view

        view = await self._database.write(insert)
        self.publish("scan", {"scan_id": scan_id, "view": view.view, "at": created_at})
        return view

    async def latest_scans_with_views(self, limit: int) -> list[str]:
        """Ids of up to `limit` scans that have views, the most recently extended first."""
        query = "SELECT scan_id FROM scan_views GROUP BY scan_id ORDER BY max(rowid) DESC LIMIT ?"
        rows = await self._database.read(lambda db: db.execute(query, (limit,)).fetchall())
        return [scan_id for (scan_id,) in rows]

    async def scan_views(self, scan_id: str) -> list[ScanViewDocument]:
        """The views of a scan in the order of their arrival."""

        def read(db: sqlite3.Connection) -> list[ScanViewDocument]:
            with parsing(f"a view of scan {scan_id}"):
                return views_of(db, scan_id)

        return await self._database.read(read)

    # files

    async def write_file(self, path: Path, blocks: Iterable[bytes]) -> None:
        """Write a file atomically and durably. Raises StorageError."""
        await self._database.write_files(lambda: self._write_file(path, blocks), path)

    async def read_file(self, path: Path) -> bytes:
        """The content of a file of the store. Raises NotFound, StorageError."""

        def read() -> bytes:
            try:
                return path.read_bytes()
            except (FileNotFoundError, IsADirectoryError):
                raise NotFound.file(path) from None

        return await self._database.run(read, path)

    async def ping(self) -> None:
        """Wait until the store's thread answers; for the watchdog."""
        await self._database.read(lambda db: db.execute("SELECT 1").fetchone())
