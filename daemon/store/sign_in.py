"""Signs browsers in and out: exchanges a key or a pairing code for a session, and finds the caller of a cookie."""

import secrets
from contextlib import suppress
from dataclasses import dataclass, field

from daemon.access.browser_sessions import (
    MAX_SESSION_S,
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
from daemon.store.access_keys import AccessKeys
from daemon.store.actor import AuditContext
from daemon.store.browser_sessions import BrowserSessions

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
