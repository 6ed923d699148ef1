"""Keys on the disk. Each change is one transaction with its audit row; nothing is ever deleted."""

import sqlite3
from dataclasses import astuple

from daemon.access.errors import KeyExists
from daemon.access.keys import KeyRecord, id_of, same
from daemon.errors import NotFound
from daemon.store.actor import Behalf, append_audit
from daemon.store.database import Database

_COLUMNS = "id, name, role, hash, created_at, expires_at, revoked_at"


class AccessKeys:
    """Who may come in. Other processes may change them: they are looked up at every request."""

    def __init__(self, database: Database) -> None:
        self._database = database

    async def all(self) -> list[KeyRecord]:
        """The oldest first, revoked ones among them."""
        return await self._database.read(_all)

    async def any_ever(self) -> bool:
        """Was there ever one? Then they are required, also when the last one has expired."""
        return await self._database.read(lambda db: _count(db) > 0)

    async def found(self, key: str) -> KeyRecord | None:
        """The record of a key, valid or not; None for one that was never given out."""
        key_id = id_of(key)
        query = f"SELECT {_COLUMNS} FROM access_keys WHERE id = ?"
        row = await self._database.read(lambda db: db.execute(query, (key_id,)).fetchone())
        if row is None:
            return None
        record = KeyRecord(*row)
        return record if same(key, record.hash) else None

    async def add(self, record: KeyRecord, behalf: Behalf, *, only_first: bool = False) -> None:
        """Raises KeyExists: names are unique among valid keys; `only_first`: when there was any before."""

        def insert(db: sqlite3.Connection) -> None:
            if only_first and _count(db):
                raise KeyExists("there are keys already", "ask an admin for one")
            _require_free(db, record)
            db.execute("INSERT INTO access_keys VALUES (?, ?, ?, ?, ?, ?, ?)", astuple(record))
            append_audit(db, behalf, record.created_at, "key added", record.id, name=record.name, role=record.role,
                         expires_at=record.expires_at)  # fmt: skip

        await self._database.write(insert)

    async def rotate(self, name: str, record: KeyRecord, until: str, behalf: Behalf) -> KeyRecord:
        """A new key of the same name and role; the old one ends at `until`. Raises NotFound."""

        def replace_it(db: sqlite3.Connection) -> KeyRecord:
            old = _valid_of(db, name, record.created_at)
            new = KeyRecord(record.id, old.name, old.role, record.hash, record.created_at, record.expires_at)
            ends = until if old.expires_at is None else min(until, old.expires_at)
            db.execute("UPDATE access_keys SET expires_at = ? WHERE id = ?", (ends, old.id))
            db.execute("INSERT INTO access_keys VALUES (?, ?, ?, ?, ?, ?, ?)", astuple(new))
            append_audit(db, behalf, record.created_at, "key rotated", old.id, name=name, by=new.id, until=ends)
            return new

        return await self._database.write(replace_it)

    async def revoke(self, name: str, at: str, behalf: Behalf) -> list[str]:
        """Every valid key of that name; answers their ids. Raises NotFound."""

        def end(db: sqlite3.Connection) -> list[str]:
            ids = [record.id for record in _all(db) if name in (record.name, record.id) and record.valid(at)]
            if not ids:
                raise NotFound(f"there is no valid key called {name!r}", "list them: handeyed keys list CONFIG")
            for key_id in ids:
                db.execute("UPDATE access_keys SET revoked_at = ? WHERE id = ?", (at, key_id))
                append_audit(db, behalf, at, "key revoked", key_id, name=name)
            return ids

        return await self._database.write(end)


def _all(db: sqlite3.Connection) -> list[KeyRecord]:
    rows = db.execute(f"SELECT {_COLUMNS} FROM access_keys ORDER BY rowid").fetchall()
    return [KeyRecord(*row) for row in rows]


def _count(db: sqlite3.Connection) -> int:
    return int(db.execute("SELECT count(*) FROM access_keys").fetchone()[0])


def _require_free(db: sqlite3.Connection, record: KeyRecord) -> None:
    if any(other.name == record.name and other.valid(record.created_at) for other in _all(db)):
        raise KeyExists(f"there is a valid key called {record.name!r}", "choose another name, or rotate that one")


def _valid_of(db: sqlite3.Connection, name: str, now: str) -> KeyRecord:
    """The latest valid key of that name, or id."""
    for record in reversed(_all(db)):
        if name in (record.name, record.id) and record.valid(now):
            return record
    raise NotFound(f"there is no valid key called {name!r}", "list them: handeyed keys list CONFIG")
