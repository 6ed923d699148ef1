"""The table of browser sessions; signs browsers in and out, and finds the caller of a cookie.

Beginning and ending a session is a transaction with its audit row.
"""

import secrets
import sqlite3
from contextlib import suppress
from dataclasses import astuple, dataclass, field
from functools import partial

from daemon.access.browser_sessions import (
    MAX_SESSION_S,
    MAX_SESSIONS_PER_KEY,
    TOKEN_BYTES,
    BrowserSession,
    RandomToken,
    timestamp_of,
)
from daemon.access.errors import KeyMissing, PairingRefused, RoleTooLow, TooManyAttempts
from daemon.access.keys import KeyRecord, hash_key
from daemon.access.pairing import MAX_PAIRING_S, AttemptLimit, Pairing, PairingCodes
from daemon.access.roles import ROLES, Caller, Role
from daemon.errors import StorageError
from daemon.runtime.clock import Clock
from daemon.runtime.shared_reading import SharedReading
from daemon.store.access_keys import AccessKeys
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


TOUCH_S = 20.0
"""A touch is stored when the stored one is older than this."""


@dataclass(eq=False)
class SignIn:
    """Begins and ends sessions. A token itself is only returned, never stored.

    `idle_s`: without a touch for this long a session has the role of a viewer; 0: never.
    """

    keys: AccessKeys
    sessions: BrowserSessions
    clock: Clock
    idle_s: float
    random_token: RandomToken = secrets.token_urlsafe
    pairing: PairingCodes = field(init=False)
    _attempts: AttemptLimit = field(init=False)

    def __post_init__(self) -> None:
        self.pairing = PairingCodes(secrets.choice, self.clock.monotonic_s)
        self._attempts = AttemptLimit(self.clock.monotonic_s)

    async def with_key(self, key: str, peer: str, network: str) -> tuple[str, BrowserSession, KeyRecord]:
        """The token and records of a new session of a key. Raises KeyMissing, TooManyAttempts, StorageError."""
        self._count_attempt(network)
        record = await self.keys.find(key.strip())
        if record is None:
            raise KeyMissing("this key is not known")
        return await self._begin(self._require_valid(record), ROLES[record.role], peer)

    async def with_code(self, code: str, peer: str, network: str) -> tuple[str, BrowserSession, KeyRecord]:
        """As `with_key`, for the key of who made the pairing code. Raises PairingRefused, too.

        The session ends with the one that made the code, and no later.
        """
        self._count_attempt(network)
        pairing = self.pairing.redeem(code)
        records = {record.id: record for record in await self.keys.all()}
        parents: dict[str | None, BrowserSession | None] = {None: None}
        parents.update(await self.sessions.all())
        if pairing is None or (record := records.get(pairing.key_id)) is None or pairing.parent not in parents:
            raise PairingRefused("this code is not open", "make another on the screen that is signed in")
        return await self._begin(self._require_valid(record), pairing.role, peer, pairing, parents[pairing.parent])

    def pair(self, caller: Caller, session: BrowserSession | None, role: Role | None) -> tuple[str, str, Role]:
        """A code for another screen, when it ends, and up to which role. `session`: of the caller, None with a key.

        Raises PairingRefused, RoleTooLow.
        """
        if not caller.key_id:
            raise PairingRefused("there are no keys: nobody is asked on this machine", "make a key first: POST /setup")
        wanted = caller.role if role is None else role
        if wanted > caller.role:
            raise RoleTooLow(caller.name, caller.role.word, wanted.word)
        code = self.pairing.begin(caller.key_id, wanted, None if session is None else session.hash)
        return code, timestamp_of(self.clock.utc_now(), MAX_PAIRING_S), wanted

    async def find(self, token: str) -> tuple[BrowserSession, KeyRecord]:
        """The session of a token and its key. Raises KeyMissing when either is not valid, StorageError."""
        session = (await self.sessions.all()).get(hash_key(token))
        now = self.clock.timestamp()
        if session is None or not session.valid(now):
            raise KeyMissing("this session has ended")
        for record in await self.keys.all():
            if record.id == session.key_id:
                return session, self._require_valid(record)
        raise KeyMissing("this session's key is not known")

    def caller(self, session: BrowserSession, key: KeyRecord, *, also_idle: bool) -> Caller:
        """Who asks with this session. `also_idle`: with its full role, however long ago it was touched."""
        idle_since = "" if also_idle or not self.idle_s else timestamp_of(self.clock.utc_now(), -self.idle_s)
        return session.caller(key, idle_since)

    async def touch(self, session: BrowserSession) -> None:
        """Note that somebody acts; a lapsed role does not come back by it. A store that fails is passed over."""
        now = self.clock.utc_now()
        if session.touched_at < timestamp_of(now, -TOUCH_S):
            with suppress(StorageError):
                await self.sessions.touch(session.hash, timestamp_of(now))

    async def end(self, token: str, context: AuditContext) -> None:
        """End the session of a token. Raises StorageError."""
        await self.sessions.end(hash_key(token), self.clock.timestamp(), context)

    async def _begin(
        self,
        key: KeyRecord,
        role: Role,
        peer: str,
        pairing: Pairing | None = None,
        parent: BrowserSession | None = None,
    ) -> tuple[str, BrowserSession, KeyRecord]:
        token, now = self.random_token(TOKEN_BYTES), self.clock.timestamp()
        ends = timestamp_of(self.clock.utc_now(), MAX_SESSION_S)
        session = BrowserSession(
            hash_key(token), key.id, role.word, now, ends, now, peer,
            paired=pairing is not None, parent=None if parent is None else parent.hash,
        ).limited_by(parent or key).limited_by(key)  # fmt: skip
        await self.sessions.begin(session, key.name)
        return token, session, key

    def _count_attempt(self, network: str) -> None:
        if not self._attempts.allows(network):
            raise TooManyAttempts

    def _require_valid(self, record: KeyRecord) -> KeyRecord:
        if not record.valid(now := self.clock.timestamp()):
            raise KeyMissing(f"the key of {record.name!r} is {record.state(now)}")
        return record
