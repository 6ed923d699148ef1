"""Transactional outbox for webhooks: triggers write each message together with the change that it reports."""

import asyncio
import json
import logging
import sqlite3
from dataclasses import dataclass
from typing import Any

from daemon.store.database import Database

log = logging.getLogger(__name__)

MAX_MESSAGES = 100_000
"""Messages kept for a webhook that does not answer; older ones are deleted."""


@dataclass(frozen=True)
class OutboxMessage:
    """One message. `id` is the same at every attempt, so that the receiver recognises repetitions."""

    number: int
    id: str
    topic: str
    at: str
    data: dict[str, Any]


class Outbox:
    """The messages, with a read position for each webhook.

    To wait without missing a message: take `changed`, call `next`, and if it has none wait for that event.
    """

    def __init__(self, database: Database) -> None:
        self._database = database
        self.changed = asyncio.Event()
        database.commit_callbacks.append(self._wake_waiters)

    def _wake_waiters(self) -> None:
        changed, self.changed = self.changed, asyncio.Event()
        changed.set()

    async def subscribe(self, name: str) -> None:
        """Add a webhook; a new one receives the messages from now on."""
        statement = "INSERT OR IGNORE INTO webhooks SELECT ?, coalesce(max(number), 0) FROM outbox"
        await self._database.write(lambda db: db.execute(statement, (name,)))

    async def post(self, topic: str, at: str, data: dict[str, Any]) -> None:
        """Add a message that belongs to no change in the store, such as an alarm. Raises StorageError."""
        row = (topic, at, json.dumps(data))
        await self._database.write(lambda db: db.execute("INSERT INTO outbox (topic, at, data) VALUES (?, ?, ?)", row))

    async def next(self, name: str) -> OutboxMessage | None:
        """The oldest message that this webhook has not received; None without one, and for one that is damaged."""
        query = (
            "SELECT number, id, topic, at, CAST(data AS BLOB) FROM outbox"
            " WHERE number > (SELECT delivered FROM webhooks WHERE name = ?) ORDER BY number LIMIT 1"
        )
        row = await self._database.read(lambda db: db.execute(query, (name,)).fetchone())
        if row is None:
            return None
        number, message_id, topic, at, data = row
        try:
            return OutboxMessage(number, message_id, topic, at, json.loads(data))
        except (TypeError, ValueError) as error:
            log.error("message %s for webhook %s is damaged (%s): it is left out", message_id, name, error)
            await self.acknowledge(name, number)
            return None

    async def acknowledge(self, name: str, number: int) -> None:
        """Mark the message and all before it as received by this webhook."""

        def advance(db: sqlite3.Connection) -> None:
            db.execute("UPDATE webhooks SET delivered = ? WHERE name = ?", (number, name))
            db.execute("DELETE FROM outbox WHERE number <= (SELECT max(number) FROM outbox) - ?", (MAX_MESSAGES,))

        await self._database.write(advance)
