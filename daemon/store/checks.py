"""The tables of stored checks: the scanner's acceptances, and the touch tests. Each row is an answered evaluation."""

import sqlite3
from dataclasses import dataclass

from daemon.errors import NotFound
from daemon.store.actor import current_audit_context, record_change
from daemon.store.database import Database
from daemon.store.listings import read_page


@dataclass(frozen=True)
class CheckKind:
    """A table of checks: `noun` of one in the audit log, `subject` of it (column `<subject>_id`)."""

    table: str
    noun: str
    subject: str


ACCEPTANCES = CheckKind("acceptances", "acceptance", "scan")
TOUCH_TESTS = CheckKind("touch_tests", "touch", "calibration")


@dataclass(frozen=True)
class CheckRecord:
    """One check of the subject with this id; `document` is JSON."""

    id: str
    subject_id: str
    created_at: str
    created_by: str
    document: str


class Checks:
    """Inserts and reads the checks of one kind. `reader`: a connection of its own for lists."""

    def __init__(self, kind: CheckKind, database: Database, reader: Database) -> None:
        self._kind, self._database, self._reader = kind, database, reader
        self._select = f"SELECT id, {kind.subject}_id, created_at, created_by, document FROM {kind.table}"

    async def save(self, record: CheckRecord) -> None:
        """Insert a check. Raises StorageError."""
        context, kind = current_audit_context(), self._kind

        def insert(db: sqlite3.Connection) -> None:
            row = (record.id, record.subject_id, record.created_at, record.created_by, record.document)
            db.execute(f"INSERT INTO {kind.table} VALUES (?, ?, ?, ?, ?)", row)
            subject = {kind.subject: record.subject_id}
            record_change(db, context, record.created_at, kind.noun, record.id, **subject)

        await self._database.write(insert)

    async def page(self, limit: int, before: str | None) -> list[CheckRecord]:
        """Up to `limit` checks older than `before`, newest first. Raises CursorUnknown, StorageError."""
        rows = await self._reader.read(lambda db: read_page(db, self._select, self._kind.table, limit, before))
        return [CheckRecord(*row) for row in rows]

    async def of_subject(self, subject_id: str, limit: int) -> list[CheckRecord]:
        """The latest `limit` checks of one subject, oldest first. Raises StorageError."""
        query = f"{self._select} WHERE {self._kind.subject}_id = ? ORDER BY rowid DESC LIMIT ?"
        rows = await self._reader.read(lambda db: db.execute(query, (subject_id, limit)).fetchall())
        return [CheckRecord(*row) for row in rows[::-1]]

    async def get(self, check_id: str) -> CheckRecord:
        """The check with this id. Raises NotFound, StorageError."""
        row = await self._reader.read(lambda db: db.execute(f"{self._select} WHERE id = ?", (check_id,)).fetchone())
        if row is None:
            raise NotFound(f"there is no {self._kind.noun} {check_id!r}", "look into their list")
        return CheckRecord(*row)
