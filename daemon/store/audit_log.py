"""The audit log in the database: its rows, its anchor, and a check of the whole log."""

import sqlite3
from pathlib import Path
from typing import Any

from daemon.access.audit_chain import AuditAnchor, AuditRow, find_flaws
from daemon.errors import StorageInconsistent
from daemon.store.actor import AuditContext, append_audit
from daemon.store.anchor_file import read_anchor, set_anchor_aside, write_anchor
from daemon.store.consistency import ACKNOWLEDGED, AUDIT_COLUMNS, StoreFault, find_audit_fault, open_read_only
from daemon.store.database import Database, storage_errors

_MAX_SEQUENCE = 2**63 - 1


class AuditLog:
    """Reads and anchors the log. Its rows are written by the store's own changes."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._folder = database.path.parent
        self._anchored: AuditAnchor | None = None

    async def rows(self, limit: int, before: int | None) -> list[AuditRow]:
        """Up to `limit` rows with a sequence below `before`, newest first."""
        query = f"SELECT {AUDIT_COLUMNS} FROM audit WHERE sequence < ? ORDER BY sequence DESC LIMIT ?"
        end = _MAX_SEQUENCE if before is None else before
        rows = await self._database.read(lambda db: db.execute(query, (end, limit)).fetchall())
        return [AuditRow(*row) for row in rows]

    async def append(self, context: AuditContext, at: str, action: str, subject: str, **detail: Any) -> None:
        """Append a row for something that changed nothing in the store."""
        await self._database.write(lambda db: append_audit(db, context, at, action, subject, **detail))

    async def anchor(self) -> AuditAnchor | None:
        """Write the last row's sequence and hash to the anchor file, and return them.

        Raises StorageError; StorageInconsistent, and the file stays, when the log does not hold what it names.
        """
        row = await self._database.read(
            lambda db: db.execute("SELECT sequence, hash FROM audit ORDER BY sequence DESC LIMIT 1").fetchone()
        )
        if row is None:
            return None
        anchor = AuditAnchor(*row)
        if anchor != self._anchored:
            if (fault := await self.find_fault()) is not None:
                raise StorageInconsistent(fault.what, fault.fix)
            await self._database.write_files(lambda: write_anchor(self._folder, anchor), self._folder)
            self._anchored = anchor
        return anchor

    async def find_fault(self) -> StoreFault | None:
        """Compare the anchor file with the end of the log. Raises StorageError."""

        def find(db: sqlite3.Connection) -> StoreFault | None:
            anchor = read_anchor(self._folder)
            db.execute("BEGIN")
            try:
                return find_audit_fault(self._folder, db, anchor, latest_rows=1)
            finally:
                db.execute("ROLLBACK")

        return await self._database.read(find)


def check_audit_log(database: Path, anchors: list[AuditAnchor]) -> tuple[int, list[str]]:
    """The number of rows in a database's log, and its faults in words. Only reads. Raises StorageError."""
    beside = read_anchor(database.parent)  # before the rows: the log only grows
    with open_read_only(database) as connection:
        rows = [AuditRow(*row) for row in connection.execute(f"SELECT {AUDIT_COLUMNS} FROM audit ORDER BY rowid")]
        counted = connection.execute("SELECT seq FROM sqlite_sequence WHERE name = 'audit'").fetchone()
    found = find_flaws(rows, [*anchors, *([] if beside is None else [beside])])
    if counted is not None and counted[0] > len(rows):
        found.append(f"{counted[0]} rows were written, {len(rows)} are there: rows were removed")
    return len(rows), list(dict.fromkeys(found))


def acknowledge(database: Database, context: AuditContext, at: str) -> tuple[list[str], Path | None]:
    """Accept a log that is not whole: append a row with its flaws, then set the anchor aside.

    Returns the flaws, and where the anchor is kept now. Raises StorageError.
    """
    flaws = check_audit_log(database.path, [])[1]

    def append(db: sqlite3.Connection) -> None:
        append_audit(db, context, at, ACKNOWLEDGED, "audit log", flaws=flaws[:20], count=len(flaws))

    database.write_now(append)
    with storage_errors(database.path.parent):
        return flaws, set_anchor_aside(database.path.parent)
