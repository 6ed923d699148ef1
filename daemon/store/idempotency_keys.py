"""POSTs with an Idempotency-Key: that they came, what they did, how they were answered."""

import json
import sqlite3
from dataclasses import dataclass

from daemon.store.database import Database

KEPT = 100_000
"""A request a minute for two months."""


@dataclass(frozen=True)
class Remembered:
    """An earlier request. `effect`: what it stored; `status` None: the daemon ended before it was answered."""

    head: str
    body: str | None
    effect: str | None
    status: int | None
    headers: dict[str, str]
    content: bytes | None


class KeyedRequests:
    """By caller and key."""

    def __init__(self, database: Database) -> None:
        self._database = database

    async def begin(self, caller: str, key: str, head: str, at: str) -> Remembered | None:
        """Note that the request came; or answer what is remembered of it. Raises StorageError."""

        def insert(db: sqlite3.Connection) -> Remembered | None:
            found = _find(db, caller, key)
            if found is not None and (found.status is not None or found.effect is not None):
                return found
            db.execute(
                "INSERT OR REPLACE INTO requests (caller, key, head, received_at) VALUES (?, ?, ?, ?)",
                (caller, key, head, at),
            )
            db.execute("DELETE FROM requests WHERE rowid <= (SELECT max(rowid) FROM requests) - ?", (KEPT,))
            return None

        return await self._database.write(insert)

    async def answered(
        self, caller: str, key: str, body: str, status: int, headers: dict[str, str], content: bytes | None
    ) -> None:
        """Remember the answer. Raises StorageError."""
        row = (body, status, json.dumps(headers), content, caller, key)
        statement = "UPDATE requests SET body = ?, status = ?, headers = ?, content = ? WHERE caller = ? AND key = ?"
        await self._database.write(lambda db: db.execute(statement, row))

    async def forget(self, caller: str, key: str) -> None:
        """Nothing was done for it: the key is free again. Raises StorageError."""
        statement = "DELETE FROM requests WHERE caller = ? AND key = ? AND effect IS NULL"
        await self._database.write(lambda db: db.execute(statement, (caller, key)))

    async def effect(self, caller: str, key: str) -> str | None:
        """What the request has stored so far."""
        found = await self._database.read(lambda db: _find(db, caller, key))
        return None if found is None else found.effect


def _find(db: sqlite3.Connection, caller: str, key: str) -> Remembered | None:
    query = "SELECT head, body, effect, status, headers, content FROM requests WHERE caller = ? AND key = ?"
    row = db.execute(query, (caller, key)).fetchone()
    if row is None:
        return None
    head, body, effect, status, headers, content = row
    return Remembered(head, body, effect, status, json.loads(headers or "{}"), content)
