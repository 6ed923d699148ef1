"""Create, rotate and revoke API keys, for the command line and POST /setup."""

import secrets
from dataclasses import dataclass, field
from datetime import UTC

from daemon.access.browser_sessions import timestamp_of
from daemon.access.errors import SetupRefused
from daemon.access.keys import KeyRecord, RandomHex, new_key
from daemon.access.pairing import SetupCode
from daemon.access.roles import Role
from daemon.runtime.clock import Clock
from daemon.store.access_keys import AccessKeys
from daemon.store.actor import AuditContext

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
