"""The table of the scanner's acceptances: each is the evaluation of one scan of an artefact."""

import sqlite3
from dataclasses import dataclass

from daemon.errors import NotFound
from daemon.store.actor import current_audit_context, record_change
from daemon.store.database import Database
from daemon.store.listings import read_page

_SELECT = "SELECT id, scan_id, created_at, created_by, document FROM acceptances"


@dataclass(frozen=True)
class AcceptanceRecord:
    """One acceptance; `document` is the JSON that POST /verify answered."""

    id: str
    scan_id: str
    created_at: str
    created_by: str
    document: str


class Acceptances:
    """Inserts and reads acceptances. `reader`: a connection of its own for lists."""

    def __init__(self, database: Database, reader: Database) -> None:
        self._database, self._reader = database, reader

    async def save(self, record: AcceptanceRecord) -> None:
        """Insert an acceptance. Raises StorageError."""
        context = current_audit_context()

        def insert(db: sqlite3.Connection) -> None:
            row = (record.id, record.scan_id, record.created_at, record.created_by, record.document)
            db.execute("INSERT INTO acceptances VALUES (?, ?, ?, ?, ?)", row)
            record_change(db, context, record.created_at, "acceptance", record.id, scan=record.scan_id)

        await self._database.write(insert)

    async def page(self, limit: int, before: str | None) -> list[AcceptanceRecord]:
        """Up to `limit` acceptances older than `before`, newest first. Raises CursorUnknown, StorageError."""
        rows = await self._reader.read(lambda db: read_page(db, _SELECT, "acceptances", limit, before))
        return [AcceptanceRecord(*row) for row in rows]

    async def get(self, acceptance_id: str) -> AcceptanceRecord:
        """The acceptance with this id. Raises NotFound, StorageError."""
        row = await self._reader.read(lambda db: db.execute(f"{_SELECT} WHERE id = ?", (acceptance_id,)).fetchone())
        if row is None:
            raise NotFound(f"there is no acceptance {acceptance_id!r}", "GET /acceptances lists them")
        return AcceptanceRecord(*row)
