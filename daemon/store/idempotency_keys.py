"""The table of POSTs with an Idempotency-Key: their content, their effect and their answer."""

import json
import sqlite3
from dataclasses import dataclass

from daemon.store.database import Database

MAX_REQUESTS = 100_000
"""100 000: one request a minute for two months."""


@dataclass(frozen=True)
class StoredRequest:
    """An earlier request. `effect`: what it stored; `status` None: the daemon ended before answering it."""

    head: str
    body: str | None
    effect: str | None
    status: int | None
    headers: dict[str, str]
    content: bytes | None


class IdempotencyKeys:
    """Requests by caller and key."""

    def __init__(self, database: Database) -> None:
        self._database = database

    async def begin(self, caller: str, key: str, head: str, at: str) -> StoredRequest | None:
        """Store a new request and return None; for a repetition return the earlier one. Raises StorageError."""

        def insert(db: sqlite3.Connection) -> StoredRequest | None:
            found = _find(db, caller, key)
            if found is not None and (found.status is not None or found.effect is not None):
                return found
            db.execute(
                "INSERT OR REPLACE INTO requests (caller, key, head, received_at) VALUES (?, ?, ?, ?)",
                (caller, key, head, at),
            )
            db.execute("DELETE FROM requests WHERE rowid <= (SELECT max(rowid) FROM requests) - ?", (MAX_REQUESTS,))
            return None

        return await self._database.write(insert)

    async def save_answer(
        self, caller: str, key: str, body: str, status: int, headers: dict[str, str], content: bytes | None
    ) -> None:
        """Store the answer. Raises StorageError."""
        row = (body, status, json.dumps(headers), content, caller, key)
        statement = "UPDATE requests SET body = ?, status = ?, headers = ?, content = ? WHERE caller = ? AND key = ?"
        await self._database.write(lambda db: db.execute(statement, row))

    async def forget(self, caller: str, key: str) -> None:
        """Delete a request that had no effect, so that its key can be used again. Raises StorageError."""
        statement = "DELETE FROM requests WHERE caller = ? AND key = ? AND effect IS NULL"
        await self._database.write(lambda db: db.execute(statement, (caller, key)))

    async def effect(self, caller: str, key: str) -> str | None:
        """What the request has stored so far, such as "run 20261121-090000-3f9a1c"; None for nothing."""
        found = await self._database.read(lambda db: _find(db, caller, key))
        return None if found is None else found.effect


def _find(db: sqlite3.Connection, caller: str, key: str) -> StoredRequest | None:
    query = "SELECT head, body, effect, status, headers, content FROM requests WHERE caller = ? AND key = ?"
    row = db.execute(query, (caller, key)).fetchone()
    if row is None:
        return None
    head, body, effect, status, headers, content = row
    return StoredRequest(head, body, effect, status, json.loads(headers or "{}"), content)
