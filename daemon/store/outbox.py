"""Messages for webhooks, written by triggers with the change they tell of, kept until every webhook has them."""

import asyncio
import json
import sqlite3
from dataclasses import dataclass
from typing import Any

from daemon.store.database import Database

KEPT = 100_000
"""Messages kept for a webhook that does not answer; older ones are dropped."""


@dataclass(frozen=True)
class Message:
    """`id` is the same at every attempt, so that the receiver can tell a repetition."""

    number: int
    id: str
    topic: str
    at: str
    data: dict[str, Any]


class Outbox:
    """Every webhook has its own place in it. The `bell` one held before looking rings when there may be news."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self.bell = asyncio.Event()
        database.when_written(self._ring)

    def _ring(self) -> None:
        bell, self.bell = self.bell, asyncio.Event()
        bell.set()

    async def subscribe(self, name: str) -> None:
        """A webhook that is new begins with what happens from now on."""
        statement = "INSERT OR IGNORE INTO webhooks SELECT ?, coalesce(max(number), 0) FROM outbox"
        await self._database.write(lambda db: db.execute(statement, (name,)))

    async def post(self, topic: str, at: str, data: dict[str, Any]) -> None:
        """A message of its own, such as an alarm. Raises StorageError."""
        row = (topic, at, json.dumps(data))
        await self._database.write(lambda db: db.execute("INSERT INTO outbox (topic, at, data) VALUES (?, ?, ?)", row))

    async def next(self, name: str) -> Message | None:
        """The oldest that this webhook has not been given."""
        query = (
            "SELECT number, id, topic, at, data FROM outbox"
            " WHERE number > (SELECT delivered FROM webhooks WHERE name = ?) ORDER BY number LIMIT 1"
        )
        row = await self._database.read(lambda db: db.execute(query, (name,)).fetchone())
        if row is None:
            return None
        number, message_id, topic, at, data = row
        return Message(number, message_id, topic, at, json.loads(data))

    async def delivered(self, name: str, number: int) -> None:
        """This webhook has it, and everything before it."""

        def advance(db: sqlite3.Connection) -> None:
            db.execute("UPDATE webhooks SET delivered = ? WHERE name = ?", (number, name))
            db.execute("DELETE FROM outbox WHERE number <= (SELECT max(number) FROM outbox) - ?", (KEPT,))

        await self._database.write(advance)

    async def waiting(self) -> dict[str, int]:
        """How many messages each webhook has not been given yet."""
        query = "SELECT name, (SELECT count(*) FROM outbox WHERE number > delivered) FROM webhooks ORDER BY name"
        return dict(await self._database.read(lambda db: db.execute(query).fetchall()))
