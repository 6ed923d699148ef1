"""The table of API keys, and what makes, rotates and revokes them. Each change is a transaction with its audit row.

No row is ever deleted.
"""

import asyncio
import secrets
import sqlite3
from collections.abc import Callable, Iterable
from dataclasses import astuple, dataclass, field
from datetime import UTC

from daemon.access.actor_names import skeleton
from daemon.access.browser_sessions import timestamp_of
from daemon.access.errors import KeyExists, SetupRefused
from daemon.access.keys import KeyRecord, RandomHex, id_of, matches, new_key
from daemon.access.pairing import SetupCode
from daemon.access.roles import Role
from daemon.errors import NotFound
from daemon.runtime.clock import Clock
from daemon.runtime.shared_reading import SharedReading
from daemon.store.actor import AuditContext, append_audit
from daemon.store.database import Answer, Database

RECENT_S = 1.0
"""How old a reading may be for who must not wait for another one: a key's end is noticed within a second."""

_COLUMNS = "id, name, role, hash, created_at, expires_at, revoked_at"


class AccessKeys:
    """The API keys. Read from the database at every request, because other processes may change them.

    `reader`: a connection of its own for reading, so that a look-up does not wait for the store's other work; requests
    at the same time share one reading.
    """

    def __init__(self, database: Database, reader: Database | None = None) -> None:
        self._database, self._reader = database, reader or database
        self._any_ever = False
        self._rows = SharedReading(self._read)
        self._latest: tuple[float, list[KeyRecord]] | None = None

    async def all(self) -> list[KeyRecord]:
        """All keys, including expired and revoked ones, oldest first."""
        return await self._rows.read()

    async def any_ever(self, *, recent: bool = False) -> bool:
        """True when a key was ever added. From then on requests need one, also after the last has expired.

        `recent`: as read within RECENT_S, without waiting for a thread.
        """
        if not self._any_ever:
            known = self._recent() if recent else None
            self._any_ever = bool(await self._rows.read() if known is None else known)
        return self._any_ever

    async def find(self, key: str, *, recent: bool = False) -> KeyRecord | None:
        """The record of a key, valid or not; None for an unknown key. `recent`: if it was read within RECENT_S."""
        known = self._recent() if recent else None
        return _record_of(key, known or []) or _record_of(key, await self._rows.read())

    async def add(self, record: KeyRecord, context: AuditContext, *, only_first: bool = False) -> None:
        """Insert a key. Raises KeyExists when a valid key has its name, or, with `only_first`, when any key exists."""

        def insert(db: sqlite3.Connection) -> None:
            if only_first and db.execute("SELECT count(*) FROM access_keys").fetchone()[0]:
                raise KeyExists("there are keys already", "ask an admin for one")
            alike = {record.name, skeleton(record.name)}
            for other in _all(db):
                if other.valid(record.created_at) and not alike.isdisjoint({other.name, skeleton(other.name)} - {""}):
                    raise KeyExists(
                        f"there is a valid key called {other.name!r}", "choose another name, or rotate that one"
                    )
            db.execute("INSERT INTO access_keys VALUES (?, ?, ?, ?, ?, ?, ?)", astuple(record))
            append_audit(db, context, record.created_at, "key added", record.id, name=record.name, role=record.role,
                         expires_at=record.expires_at)  # fmt: skip

        await self._write(insert)

    async def rotate(self, name: str, record: KeyRecord, until: str, context: AuditContext) -> KeyRecord:
        """Insert a key with the name and role of `name`; the newest old one expires at `until`. Raises NotFound."""

        def replace_it(db: sqlite3.Connection) -> KeyRecord:
            old = _valid_of(db, name, record.created_at)[-1]
            new = KeyRecord(record.id, old.name, old.role, record.hash, record.created_at, record.expires_at)
            ends = until if old.expires_at is None else min(until, old.expires_at)
            db.execute("UPDATE access_keys SET expires_at = ? WHERE id = ?", (ends, old.id))
            db.execute("INSERT INTO access_keys VALUES (?, ?, ?, ?, ?, ?, ?)", astuple(new))
            append_audit(db, context, record.created_at, "key rotated", old.id, name=name, by=new.id, until=ends)
            return new

        return await self._write(replace_it)

    async def revoke(self, name: str, at: str, context: AuditContext) -> list[str]:
        """Revoke every valid key with that name or id; returns their ids. Raises NotFound."""

        def end(db: sqlite3.Connection) -> list[str]:
            ids = [record.id for record in _valid_of(db, name, at)]
            for key_id in ids:
                db.execute("UPDATE access_keys SET revoked_at = ? WHERE id = ?", (at, key_id))
                append_audit(db, context, at, "key revoked", key_id, name=name)
            return ids

        return await self._write(end)

    async def _read(self) -> list[KeyRecord]:
        rows = await self._reader.read(_all)
        self._latest = asyncio.get_running_loop().time(), rows
        return rows

    def _recent(self) -> list[KeyRecord] | None:
        """The keys as read within RECENT_S; None when there was no reading, or a change after it."""
        if self._latest is None or asyncio.get_running_loop().time() - self._latest[0] > RECENT_S:
            return None
        return self._latest[1]

    async def _write(self, change: Callable[[sqlite3.Connection], Answer]) -> Answer:
        try:
            return await self._database.write(change)
        finally:
            self._latest = None


def _record_of(key: str, records: Iterable[KeyRecord]) -> KeyRecord | None:
    key_id = id_of(key)
    return next((record for record in records if record.id == key_id and matches(key, record.hash)), None)


def _all(db: sqlite3.Connection) -> list[KeyRecord]:
    rows = db.execute(f"SELECT {_COLUMNS} FROM access_keys ORDER BY rowid").fetchall()
    return [KeyRecord(*row) for row in rows]


def _valid_of(db: sqlite3.Connection, name: str, now: str) -> list[KeyRecord]:
    """The valid keys with that name or id, oldest first. Raises NotFound without one."""
    found = [record for record in _all(db) if name in (record.name, record.id) and record.valid(now)]
    if not found:
        raise NotFound(f"there is no valid key called {name!r}", "list them: handeyed keys list CONFIG")
    return found


DEFAULT_DAYS = 365
OVERLAP_H = 24.0
"""How long a rotated key stays valid, so that clients can change to the new one without interruption."""


@dataclass(frozen=True)
class KeyService:
    """Creates, rotates and revokes keys. A key itself is only returned, never stored."""

    keys: AccessKeys
    clock: Clock
    code: SetupCode = field(default_factory=lambda: SetupCode(secrets.choice))
    random_hex: RandomHex = secrets.token_hex

    async def add(
        self,
        name: str,
        role: Role,
        context: AuditContext,
        days: float | None = DEFAULT_DAYS,
        *,
        only_first: bool = False,
    ) -> tuple[str, KeyRecord]:
        """Create a key; returns it and its record. `days` None: it never expires. Raises KeyExists, StorageError."""
        key, key_id, key_hash = new_key(self.random_hex)
        record = KeyRecord(key_id, name, role.word, key_hash, self.clock.timestamp(), self._in_days(days))
        await self.keys.add(record, context, only_first=only_first)
        return key, record

    async def rotate(
        self, name: str, context: AuditContext, days: float | None = DEFAULT_DAYS, overlap_h: float = OVERLAP_H
    ) -> tuple[str, KeyRecord]:
        """Create a key of the same name and role; the old one ends after `overlap_h`. Raises NotFound, StorageError."""
        key, key_id, key_hash = new_key(self.random_hex)
        record = KeyRecord(key_id, name, "", key_hash, self.clock.timestamp(), self._in_days(days))
        until = self._in_days(overlap_h / 24)
        assert until is not None
        return key, await self.keys.rotate(name, record, until, context)

    async def revoke(self, name: str, context: AuditContext) -> list[str]:
        """Revoke every valid key of that name now; returns their ids. Raises NotFound, StorageError."""
        return await self.keys.revoke(name, self.clock.timestamp(), context)

    async def require_none(self) -> None:
        """Raises SetupRefused when there has ever been a key, StorageError."""
        if await self.keys.any_ever():
            raise SetupRefused("there are keys already", "ask an admin for one")

    async def set_up(self, code: str, name: str, peer: str) -> tuple[str, KeyRecord]:
        """Create the first key, with role admin, for the set-up code. Raises SetupRefused, KeyExists, StorageError."""
        await self.require_none()
        if not self.code.redeem(code):
            what = "this is not the set-up code" if self.code.usable else "the set-up code is used up"
            raise SetupRefused(what, "it stands in the daemon's log; a restart makes another")
        return await self.add(name, Role.ADMIN, AuditContext(peer, "set-up code"), only_first=True)

    def _in_days(self, days: float | None) -> str | None:
        return None if days is None else timestamp_of(self.clock.utc_now().astimezone(UTC), 86_400 * days)
