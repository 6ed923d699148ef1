"""The audit log in the database, and its anchor in a file: the last row, so that a truncated log is detected."""

import json
import sqlite3
from pathlib import Path
from typing import Any

from daemon.access.audit_chain import AuditAnchor, AuditRow, find_flaws
from daemon.runtime.durable_files import write_durably
from daemon.store.actor import AuditContext, append_audit
from daemon.store.database import Database, storage_errors

ANCHOR_NAME = "audit-anchor.json"

_COLUMNS = "sequence, at, actor, role, action, subject, detail, hash"


class AuditLog:
    """Reads, anchors and checks the log. Its rows are written by the store's own changes."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._anchored: AuditAnchor | None = None
        self.anchor_file = database.path.with_name(ANCHOR_NAME)

    async def rows(self, limit: int, before: int | None) -> list[AuditRow]:
        """Up to `limit` rows with a sequence below `before`, newest first."""
        query = f"SELECT {_COLUMNS} FROM audit WHERE ?1 IS NULL OR sequence < ?1 ORDER BY sequence DESC LIMIT ?2"
        rows = await self._database.read(lambda db: db.execute(query, (before, limit)).fetchall())
        return [AuditRow(*row) for row in rows]

    async def append(self, context: AuditContext, at: str, action: str, subject: str, **detail: Any) -> None:
        """Append a row for something that changed nothing in the store."""
        await self._database.write(lambda db: append_audit(db, context, at, action, subject, **detail))

    async def anchor(self) -> AuditAnchor | None:
        """Write the last row's sequence and hash to the anchor file, and return them. Raises StorageError."""

        row = await self._database.read(
            lambda db: db.execute("SELECT sequence, hash FROM audit ORDER BY sequence DESC LIMIT 1").fetchone()
        )
        if row is None:
            return None
        anchor = AuditAnchor(*row)
        if anchor != self._anchored:
            content = json.dumps({"sequence": anchor.sequence, "hash": anchor.hash}).encode()
            await self._database.run(lambda: write_durably(self.anchor_file, [content]), self.anchor_file)
            self._anchored = anchor
        return anchor


def check_audit_log(database: Path, anchors: list[AuditAnchor]) -> tuple[int, list[str]]:
    """The number of rows in a database's log, and its faults in words. Only reads. Raises StorageError."""
    with storage_errors(database):
        connection = sqlite3.connect(f"{database.resolve().as_uri()}?mode=ro", uri=True)
        try:
            rows = [AuditRow(*row) for row in connection.execute(f"SELECT {_COLUMNS} FROM audit ORDER BY rowid")]
            counted = connection.execute("SELECT seq FROM sqlite_sequence WHERE name = 'audit'").fetchone()
        finally:
            connection.close()
    found = find_flaws(rows, [*anchors, *_anchor_beside(database)])
    if counted is not None and counted[0] > len(rows):
        found.append(f"{counted[0]} rows were written, {len(rows)} are there: rows were removed")
    return len(rows), list(dict.fromkeys(found))


def _anchor_beside(database: Path) -> list[AuditAnchor]:
    file = database.with_name(ANCHOR_NAME)
    if not file.exists():
        return []
    with storage_errors(file):
        try:
            content = json.loads(file.read_text())
            return [AuditAnchor(int(content["sequence"]), str(content["hash"]))]
        except (ValueError, KeyError, TypeError):
            return [AuditAnchor(1, f"{file.name} cannot be read")]
