"""The tables of stored documents: the scanner's acceptances, those of extensions. None is ever changed."""

import sqlite3
from dataclasses import dataclass

from daemon.errors import NotFound
from daemon.runtime.event_bus import Publish
from daemon.store.actor import current_audit_context, record_change
from daemon.store.damaged_rows import Model, parse_stored
from daemon.store.database import Database
from daemon.store.listings import read_page


@dataclass(frozen=True)
class DocumentKind:
    """A table of documents: `noun` of one in the audit log, `column` that holds what it is about."""

    table: str
    noun: str
    column: str


ACCEPTANCES = DocumentKind("acceptances", "acceptance", "scan_id")


@dataclass(frozen=True)
class DocumentRecord:
    """One document, in JSON; `subject`: what it is about, the id of a scan or calibration, or a set-up."""

    id: str
    subject: str
    created_at: str
    created_by: str
    document: str

    def parsed(self, model: type[Model]) -> Model:
        """The document. Raises StorageInconsistent."""
        return parse_stored(model, self.document, f"row {self.id}")


class Documents:
    """Inserts and reads the documents of one kind. `reader`: a connection of its own for lists.

    `publish` is called after a document was stored, with the kind's noun.
    """

    def __init__(self, kind: DocumentKind, database: Database, reader: Database, publish: Publish) -> None:
        self._kind, self._database, self._reader, self._publish = kind, database, reader, publish
        self._select = f"SELECT id, {kind.column}, created_at, created_by, document FROM {kind.table}"

    async def save(self, record: DocumentRecord, **detail: object) -> None:
        """Insert a document; `detail` is added to its row of the audit log. Raises StorageError."""
        context, kind = current_audit_context(), self._kind

        def insert(db: sqlite3.Connection) -> None:
            row = (record.id, record.subject, record.created_at, record.created_by, record.document)
            db.execute(f"INSERT INTO {kind.table} VALUES (?, ?, ?, ?, ?)", row)
            about = {kind.column.removesuffix("_id"): record.subject}
            record_change(db, context, record.created_at, kind.noun, record.id, **about, **detail)

        await self._database.write(insert)
        self._publish(kind.noun, {f"{kind.noun}_id": record.id, kind.column: record.subject, "at": record.created_at})

    async def page(self, limit: int, before: str | None) -> list[DocumentRecord]:
        """Up to `limit` documents older than `before`, newest first. Raises CursorUnknown, StorageError."""
        rows = await self._reader.read(lambda db: read_page(db, self._select, self._kind.table, limit, before))
        return [DocumentRecord(*row) for row in rows]

    async def about(self, subject: str, limit: int) -> list[DocumentRecord]:
        """The latest `limit` documents about one subject, oldest first. Raises StorageError."""
        query = f"{self._select} WHERE {self._kind.column} = ? ORDER BY rowid DESC LIMIT ?"
        rows = await self._reader.read(lambda db: db.execute(query, (subject, limit)).fetchall())
        return [DocumentRecord(*row) for row in rows[::-1]]

    async def get(self, document_id: str) -> DocumentRecord:
        """The document with this id. Raises NotFound, StorageError."""
        row = await self._reader.read(lambda db: db.execute(f"{self._select} WHERE id = ?", (document_id,)).fetchone())
        if row is None:
            raise NotFound(f"there is no {self._kind.noun} {document_id!r}", "look into their list")
        return DocumentRecord(*row)
