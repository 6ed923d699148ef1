"""The table of events: the last 1000 and their numbers survive a restart."""

import json
import sqlite3
from collections.abc import Sequence

from daemon.runtime.event_bus import MAX_EVENTS, BusEvent
from daemon.store.database import Database


class StoredEvents:
    """The EventStore of the event bus."""

    def __init__(self, database: Database) -> None:
        self._database = database

    async def last(self) -> list[BusEvent]:
        """The last MAX_EVENTS events, oldest first, without those that a damaged database holds no text of."""
        rows = await self._database.read(
            lambda db: db.execute("SELECT number, kind, data FROM events ORDER BY number").fetchall()
        )
        return [BusEvent(number, kind, json.loads(data)) for number, kind, data in rows[-MAX_EVENTS:] if data]

    async def keep(self, events: Sequence[BusEvent]) -> None:
        """Store the events in one transaction and drop old ones. Raises StorageError."""
        rows = [(event.number, event.kind, json.dumps(event.data)) for event in events]
        oldest = rows[-1][0] - 2 * MAX_EVENTS

        def insert(db: sqlite3.Connection) -> None:
            db.executemany("INSERT INTO events VALUES (?, ?, ?)", rows)
            db.execute("DELETE FROM events WHERE number <= ?", (oldest,))

        await self._database.write(insert)
