"""The table of browser sessions. Beginning and ending one is a transaction with its audit row."""

import sqlite3
from dataclasses import astuple
from functools import partial

from daemon.access.browser_sessions import MAX_SESSIONS_PER_KEY, BrowserSession
from daemon.runtime.shared_reading import SharedReading
from daemon.store.actor import AuditContext, append_audit
from daemon.store.database import Database

_COLUMNS = "hash, key_id, role, created_at, expires_at, touched_at, peer, paired, parent"

_WITH_CHILDREN = """
    WITH RECURSIVE ended (hash) AS (
        SELECT hash FROM browser_sessions WHERE hash = ?
        UNION SELECT child.hash FROM browser_sessions AS child JOIN ended ON child.parent = ended.hash
    ) SELECT hash FROM ended
"""


class BrowserSessions:
    """The sessions, without their tokens. `reader`: a connection of its own, as for the keys."""

    def __init__(self, database: Database, reader: Database) -> None:
        self._database = database
        self._rows = SharedReading(partial(reader.read, _all))

    async def all(self) -> dict[str, BrowserSession]:
        """All sessions by their hash, also expired ones that nobody has removed yet."""
        return {session.hash: session for session in await self._rows.read()}

    async def begin(self, session: BrowserSession, name: str) -> None:
        """Insert a session of the key called `name`; removes expired ones, and the key's oldest beyond the limit."""

        def insert(db: sqlite3.Connection) -> None:
            db.execute("DELETE FROM browser_sessions WHERE expires_at <= ?", (session.created_at,))
            db.execute(
                "DELETE FROM browser_sessions WHERE key_id = ? AND hash NOT IN (SELECT hash FROM browser_sessions"
                " WHERE key_id = ? ORDER BY rowid DESC LIMIT ?)",
                (session.key_id, session.key_id, MAX_SESSIONS_PER_KEY - 1),
            )
            db.execute(
                f"INSERT INTO browser_sessions ({_COLUMNS}) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", astuple(session)
            )
            context = AuditContext(name, session.role, session.key_id, session=session.id)
            append_audit(db, context, session.created_at, "session begun", session.id, peer=session.peer,
                         paired=session.paired, until=session.expires_at)  # fmt: skip

        await self._database.write(insert)

    async def end(self, session_hash: str, at: str, context: AuditContext) -> None:
        """Remove a session, if it is there, and with it those that it has paired, and so on."""

        def remove(db: sqlite3.Connection) -> None:
            ended = db.execute(_WITH_CHILDREN, (session_hash,)).fetchall()
            db.execute("DELETE FROM browser_sessions WHERE hash = ?", (session_hash,))  # the others by their parent
            for (each,) in ended:
                append_audit(db, context, at, "session ended", each[:8])

        await self._database.write(remove)

    async def touch(self, session_hash: str, at: str) -> None:
        """Note that somebody acted in this session at `at`."""
        await self._database.write(
            lambda db: db.execute("UPDATE browser_sessions SET touched_at = ? WHERE hash = ?", (at, session_hash))
        )


def _all(db: sqlite3.Connection) -> list[BrowserSession]:
    rows = db.execute(f"SELECT {_COLUMNS} FROM browser_sessions").fetchall()
    return [BrowserSession(*(*row[:-2], bool(row[-2]), row[-1])) for row in rows]
