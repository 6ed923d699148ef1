"""The audit log on the disk, and its anchor beside it: how far it had come, so that a cut-off end is noticed."""

import json
import sqlite3
from pathlib import Path
from typing import Any

from daemon.access.audit_chain import Anchor, AuditRow, flaws
from daemon.runtime.durable_files import write_durably
from daemon.store.actor import Behalf, append_audit
from daemon.store.database import Database, storage_errors

ANCHOR_NAME = "audit-anchor.json"

_COLUMNS = "sequence, at, actor, role, action, subject, detail, hash"


class AuditLog:
    """Rows are written by the store's changes themselves; this reads, anchors and checks them."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._anchored: Anchor | None = None
        self.anchor_file = database.path.with_name(ANCHOR_NAME)

    async def rows(self, limit: int, before: int | None) -> list[AuditRow]:
        """The newest first."""
        query = f"SELECT {_COLUMNS} FROM audit WHERE ?1 IS NULL OR sequence < ?1 ORDER BY sequence DESC LIMIT ?2"
        rows = await self._database.read(lambda db: db.execute(query, (before, limit)).fetchall())
        return [AuditRow(*row) for row in rows]

    async def append(self, behalf: Behalf, at: str, action: str, subject: str, **detail: Any) -> None:
        """A row of its own: something that changed nothing, but is worth knowing."""
        await self._database.write(lambda db: append_audit(db, behalf, at, action, subject, **detail))

    async def anchor(self) -> Anchor | None:
        """Write down how far the log has come. Raises StorageError."""

        row = await self._database.read(
            lambda db: db.execute("SELECT sequence, hash FROM audit ORDER BY sequence DESC LIMIT 1").fetchone()
        )
        if row is None:
            return None
        anchor = Anchor(*row)
        if anchor != self._anchored:
            content = json.dumps({"sequence": anchor.sequence, "hash": anchor.hash}).encode()
            await self._database.run(lambda: write_durably(self.anchor_file, [content]), self.anchor_file)
            self._anchored = anchor
        return anchor


def found_flaws(database: Path, anchors: list[Anchor]) -> tuple[int, list[str]]:
    """How many rows a database's log has, and what is wrong with it. Only reads. Raises StorageError."""
    with storage_errors(database):
        connection = sqlite3.connect(f"{database.resolve().as_uri()}?mode=ro", uri=True)
        try:
            rows = [AuditRow(*row) for row in connection.execute(f"SELECT {_COLUMNS} FROM audit ORDER BY rowid")]
            counted = connection.execute("SELECT seq FROM sqlite_sequence WHERE name = 'audit'").fetchone()
        finally:
            connection.close()
    found = flaws(rows, [*anchors, *_anchor_beside(database)])
    if counted is not None and counted[0] > len(rows):
        found.append(f"{counted[0]} rows were written, {len(rows)} are there: rows were removed")
    return len(rows), list(dict.fromkeys(found))


def _anchor_beside(database: Path) -> list[Anchor]:
    file = database.with_name(ANCHOR_NAME)
    if not file.exists():
        return []
    with storage_errors(file):
        try:
            content = json.loads(file.read_text())
            return [Anchor(int(content["sequence"]), str(content["hash"]))]
        except (ValueError, KeyError, TypeError):
            return [Anchor(1, f"{file.name} cannot be read")]
