"""Events on the disk, so that their numbers and the last of them survive a restart."""

import json
import sqlite3
from collections.abc import Sequence

from daemon.runtime.event_bus import KEPT, Event
from daemon.store.database import Database


class KeptEvents:
    """The last events."""

    def __init__(self, database: Database) -> None:
        self._database = database

    async def last(self) -> list[Event]:
        """In their order."""
        rows = await self._database.read(
            lambda db: db.execute("SELECT number, kind, data FROM events ORDER BY number").fetchall()
        )
        return [Event(number, kind, json.loads(data)) for number, kind, data in rows[-KEPT:]]

    async def keep(self, events: Sequence[Event]) -> None:
        """All of them or none. Raises StorageError."""
        rows = [(event.number, event.kind, json.dumps(event.data)) for event in events]
        oldest = rows[-1][0] - 2 * KEPT

        def insert(db: sqlite3.Connection) -> None:
            db.executemany("INSERT INTO events VALUES (?, ?, ?)", rows)
            db.execute("DELETE FROM events WHERE number <= ?", (oldest,))

        await self._database.write(insert)
