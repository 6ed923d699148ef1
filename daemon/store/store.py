"""Everything that survives a restart. Each call returns when what it wrote is on the disk."""

import sqlite3
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from calibration.documents.calibration import CalibrationDocument
from calibration.documents.pose import PoseDocument
from daemon.errors import AppliedMeanwhile, CursorUnknown, NoCalibration, NotFound
from daemon.model.records import Applied, CalibrationRecord, RunRecord, ScanRecord, ScanView, Unit
from daemon.model.run_states import FINAL_STATES
from daemon.runtime.durable_files import WriteFile, settle_file, write_durably
from daemon.runtime.failpoints import NEVER, Failpoints
from daemon.store.access_keys import AccessKeys
from daemon.store.actor import current_behalf, note
from daemon.store.audit_log import AuditLog
from daemon.store.database import DATABASE_NAME, Database
from daemon.store.event_log import KeptEvents
from daemon.store.idempotency_keys import KeyedRequests
from daemon.store.lock import FolderHold
from daemon.store.outbox import Outbox

_UPDATE_RUN = (
    "UPDATE runs SET (id, kind, state, station, stations, code, cause, fix, created_at, updated_at, request, result,"
    " planning) = (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?) WHERE id = ?"
)

_CALIBRATION = "SELECT id, run_id, created_at, accepted, document FROM calibrations"


class Store:
    """SQLite, and big files beside it: runs/ID/ and scans/ID/ are folders that the command line reads too."""

    def __init__(self, folder: Path, write_file: WriteFile | None = None, at: Failpoints = NEVER) -> None:
        """Opens or creates the store in `folder`. Raises StorageError, StorageTooNew, StorageInUse."""
        self.folder = folder
        self._write_file = write_file or partial(write_durably, at=at)
        self._at = at
        self._hold = FolderHold(folder / f"{DATABASE_NAME}.in-use")
        try:
            self._database = Database(folder / DATABASE_NAME, at=at)
        except BaseException:
            self._hold.release()
            raise
        self.keyed_requests = KeyedRequests(self._database)
        self.kept_events = KeptEvents(self._database)
        self.outbox = Outbox(self._database)
        self.access_keys = AccessKeys(self._database)
        self.audit = AuditLog(self._database)

    async def close(self) -> None:
        await self._database.close()
        self._hold.release()

    # runs

    def run_folder(self, run_id: str) -> Path:
        return self.folder / "runs" / run_id

    async def save_run(self, run: RunRecord) -> None:
        """Insert the run, or bring its row up to date."""
        behalf, row = current_behalf(), run.row()

        def save(db: sqlite3.Connection) -> None:
            if not db.execute(_UPDATE_RUN, (*row, run.id)).rowcount:
                db.execute(f"INSERT INTO runs VALUES ({', '.join('?' * len(row))})", row)
                note(db, behalf, run.created_at, "run", run.id, kind=run.kind)

        await self._database.write(save)

    async def run(self, run_id: str) -> RunRecord:
        """Raises NotFound."""
        row = await self._database.read(lambda db: db.execute("SELECT * FROM runs WHERE id = ?", (run_id,)).fetchone())
        if row is None:
            raise NotFound(f"there is no run {run_id!r}", "GET /runs lists them")
        return RunRecord.of(row)

    async def runs(self, limit: int, before: str | None = None) -> list[RunRecord]:
        """The newest first; `before` is the id of the last one already seen. Raises CursorUnknown."""
        return [RunRecord.of(row) for row in await self._page("SELECT * FROM runs", "runs", limit, before)]

    async def unfinished_runs(self) -> list[RunRecord]:
        """Runs that a stopped daemon left behind."""
        states = tuple(str(state) for state in sorted(FINAL_STATES))
        marks = ", ".join("?" * len(states))
        rows = await self._database.read(
            lambda db: db.execute(f"SELECT * FROM runs WHERE state NOT IN ({marks})", states).fetchall()
        )
        return [RunRecord.of(row) for row in rows]

    # calibrations

    async def save_calibration(self, calibration: CalibrationRecord) -> None:
        """Insert a calibration; it is never changed afterwards."""
        row = (calibration.id, calibration.run_id, calibration.created_at, calibration.accepted,
               calibration.document.model_dump_json())  # fmt: skip
        await self._database.write(lambda db: db.execute("INSERT INTO calibrations VALUES (?, ?, ?, ?, ?)", row))

    async def calibration(self, calibration_id: str) -> CalibrationRecord:
        """Raises NotFound."""
        row = await self._database.read(
            lambda db: db.execute(f"{_CALIBRATION} WHERE id = ?", (calibration_id,)).fetchone()
        )
        if row is None:
            raise NotFound(f"there is no calibration {calibration_id!r}", "GET /calibrations lists them")
        return _calibration(row)

    async def calibrations(self, limit: int, before: str | None = None) -> list[CalibrationRecord]:
        """The newest first; `before` is the id of the last one already seen. Raises CursorUnknown."""
        return [_calibration(row) for row in await self._page(_CALIBRATION, "calibrations", limit, before)]

    async def apply(self, applied: Applied, expected: Sequence[int] | None = None) -> Applied:
        """Make a calibration current; the history is kept. Answers it with its place in the history.

        `expected`: only if what is in force now is one of these (0: nothing). Raises AppliedMeanwhile.
        """
        behalf = current_behalf()

        def insert(db: sqlite3.Connection) -> int:
            (now,) = db.execute("SELECT coalesce(max(sequence), 0) FROM applied").fetchone()
            if expected is not None and now not in expected:
                raise AppliedMeanwhile(now)
            row = (applied.calibration_id, applied.applied_at, applied.applied_by)
            db.execute("INSERT INTO applied (calibration_id, applied_at, applied_by) VALUES (?, ?, ?)", row)
            (sequence,) = db.execute("SELECT last_insert_rowid()").fetchone()
            note(db, behalf, applied.applied_at, "apply", str(sequence), calibration=applied.calibration_id,
                 by=applied.applied_by)  # fmt: skip
            return int(sequence)

        return replace(applied, sequence=await self._database.write(insert))

    async def applied(self, limit: int = 1) -> list[Applied]:
        """What was current, the newest first; the first of them is."""
        query = "SELECT calibration_id, applied_at, applied_by, sequence FROM applied ORDER BY sequence DESC LIMIT ?"
        rows = await self._database.read(lambda db: db.execute(query, (limit,)).fetchall())
        return [Applied(*row) for row in rows]

    async def applied_at_place(self, sequence: int) -> Applied:
        """One of the history. Raises NotFound."""
        query = "SELECT calibration_id, applied_at, applied_by, sequence FROM applied WHERE sequence = ?"
        row = await self._database.read(lambda db: db.execute(query, (sequence,)).fetchone())
        if row is None:
            raise NotFound(f"nothing was applied as number {sequence}", "GET /calibrations lists what was")
        return Applied(*row)

    async def current(self) -> tuple[Applied, CalibrationRecord]:
        """The calibration in force. Raises NoCalibration."""
        for applied in await self.applied():
            return applied, await self.calibration(applied.calibration_id)
        raise NoCalibration

    # scans

    def scan_folder(self, scan_id: str) -> Path:
        return self.folder / "scans" / scan_id

    async def save_scan(self, scan: ScanRecord) -> None:
        behalf, row = current_behalf(), (scan.id, scan.created_at, scan.name, scan.refine)

        def insert(db: sqlite3.Connection) -> None:
            db.execute("INSERT INTO scans VALUES (?, ?, ?, ?)", row)
            note(db, behalf, scan.created_at, "scan", scan.id, name=scan.name)

        await self._database.write(insert)

    async def scan(self, scan_id: str) -> ScanRecord:
        """Raises NotFound."""
        query = "SELECT id, created_at, name, refine FROM scans WHERE id = ?"
        row = await self._database.read(lambda db: db.execute(query, (scan_id,)).fetchone())
        if row is None:
            raise NotFound(f"there is no scan {scan_id!r}", "GET /scans lists them")
        return _scan(row)

    async def scans(self, limit: int, before: str | None = None) -> list[ScanRecord]:
        """The newest first; `before` is the id of the last one already seen. Raises CursorUnknown."""
        query = "SELECT id, created_at, name, refine FROM scans"
        return [_scan(row) for row in await self._page(query, "scans", limit, before)]

    async def add_scan_view(
        self, scan_id: str, upload: Path, suffix: str, unit: Unit, base_T_flange: PoseDocument, created_at: str
    ) -> ScanView:
        """Give the uploaded file the scan's next number and name: the file is on the disk before its row is."""
        behalf = current_behalf()

        def insert(db: sqlite3.Connection) -> ScanView:
            count = db.execute("SELECT COUNT(*) FROM scan_views WHERE scan_id = ?", (scan_id,)).fetchone()[0]
            view = ScanView(count, f"view_{count:03d}{suffix}", unit, base_T_flange, created_at)
            settle_file(upload, upload.with_name(view.file), self._at)
            row = (scan_id, view.view, view.file, unit, base_T_flange.model_dump_json(), created_at)
            db.execute("INSERT INTO scan_views VALUES (?, ?, ?, ?, ?, ?)", row)
            note(db, behalf, created_at, "view", f"{scan_id} {view.view}")
            return view

        return await self._database.write(insert)

    async def latest_scans_with_views(self, limit: int) -> list[str]:
        """Whose last view came last."""
        query = "SELECT scan_id FROM scan_views GROUP BY scan_id ORDER BY max(rowid) DESC LIMIT ?"
        rows = await self._database.read(lambda db: db.execute(query, (limit,)).fetchall())
        return [scan_id for (scan_id,) in rows]

    async def scan_views(self, scan_id: str) -> list[ScanView]:
        """In the order they came."""
        query = "SELECT view, file, unit, base_T_flange, created_at FROM scan_views WHERE scan_id = ? ORDER BY view"
        rows = await self._database.read(lambda db: db.execute(query, (scan_id,)).fetchall())
        return [ScanView(v, file, unit, PoseDocument.model_validate_json(pose), at) for v, file, unit, pose, at in rows]

    async def _page(self, query: str, table: str, limit: int, before: str | None) -> list[Any]:
        """In the order of insertion, the newest first: a clock that jumps back does not hide what is new."""

        def page(db: sqlite3.Connection) -> list[Any]:
            end = None
            if before is not None:
                end = db.execute(f"SELECT rowid FROM {table} WHERE id = ?", (before,)).fetchone()
                if end is None:
                    raise CursorUnknown(table, before)
            where = "" if end is None else f"WHERE rowid < {end[0]}"
            return db.execute(f"{query} {where} ORDER BY rowid DESC LIMIT ?", (limit,)).fetchall()

        return await self._database.read(page)

    # files

    async def write_file(self, path: Path, blocks: Iterable[bytes]) -> None:
        """The file is on the disk, whole, when this returns. Raises StorageError."""
        await self._database.run(lambda: self._write_file(path, blocks), path)

    async def read_file(self, path: Path) -> bytes:
        """Raises NotFound, StorageError."""

        def read() -> bytes:
            try:
                return path.read_bytes()
            except (FileNotFoundError, IsADirectoryError):
                raise NotFound(f"there is no {path.name} in {path.parent.name}", "look at what was stored") from None

        return await self._database.run(read, path)

    async def alive(self) -> None:
        """Returns when the store's thread answers: the watchdog asks."""
        await self._database.read(lambda db: db.execute("SELECT 1").fetchone())


def _calibration(row: tuple[str, str | None, str, int, str]) -> CalibrationRecord:
    calibration_id, run_id, created_at, accepted, document = row
    return CalibrationRecord(
        calibration_id, run_id, created_at, bool(accepted), CalibrationDocument.model_validate_json(document)
    )


def _scan(row: tuple[str, str, str, int]) -> ScanRecord:
    scan_id, created_at, name, refine = row
    return ScanRecord(scan_id, created_at, name, bool(refine))
