"""Keys: 256 random bits, shown once, stored as their SHA-256. So many bits need no slow hash: nobody can guess them."""

import hashlib
import hmac
import re
from collections.abc import Callable
from dataclasses import dataclass

PREFIX = "hek"
KEY_BYTES = 32
SHAPE = re.compile(rf"{PREFIX}_([0-9a-f]{{8}})_([0-9a-f]{{64}})")

RandomHex = Callable[[int], str]
"""So many random bytes, as hexadecimal: `secrets.token_hex`."""


@dataclass(frozen=True)
class KeyRecord:
    """A key as it is stored: without the key."""

    id: str
    name: str
    role: str
    hash: str
    created_at: str
    expires_at: str | None = None
    revoked_at: str | None = None

    def valid(self, now: str) -> bool:
        """At `now`, an ISO timestamp in UTC as all of ours."""
        return self.revoked_at is None and (self.expires_at is None or now < self.expires_at)

    def state(self, now: str) -> str:
        """valid, expired or revoked."""
        if self.revoked_at is not None:
            return "revoked"
        return "valid" if self.valid(now) else "expired"


def new_key(random_hex: RandomHex) -> tuple[str, str, str]:
    """A key, its id and its hash. The key is never stored."""
    key_id, secret = random_hex(4), random_hex(KEY_BYTES)
    key = f"{PREFIX}_{key_id}_{secret}"
    return key, key_id, hash_of(key)


def hash_of(key: str) -> str:
    return hashlib.sha256(key.encode()).hexdigest()


def id_of(key: str) -> str | None:
    """Of what has the shape of a key."""
    found = SHAPE.fullmatch(key)
    return found[1] if found else None


def same(key: str, stored_hash: str) -> bool:
    """Takes as long for a wrong key as for the right one."""
    return hmac.compare_digest(hash_of(key), stored_hash)
