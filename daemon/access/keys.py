"""API keys: 256 random bits, shown once, stored as SHA-256. A slow hash is not needed at that length."""

import hashlib
import hmac
import re
from collections.abc import Callable
from dataclasses import dataclass

from daemon.runtime.logs import KEY_FORM

KEY_BYTES = 32
KEY_PATTERN = re.compile(KEY_FORM)

RandomHex = Callable[[int], str]
"""Returns n random bytes as hexadecimal, like `secrets.token_hex`."""


@dataclass(frozen=True)
class KeyRecord:
    """The stored record of a key: its hash, not the key itself."""

    id: str
    name: str
    role: str
    hash: str
    created_at: str
    expires_at: str | None = None
    revoked_at: str | None = None

    def valid(self, now: str) -> bool:
        """True when the key is neither revoked nor expired at `now`, an ISO timestamp in UTC."""
        return self.revoked_at is None and (self.expires_at is None or now < self.expires_at)

    def state(self, now: str) -> str:
        """One of "valid", "expired" and "revoked"."""
        if self.revoked_at is not None:
            return "revoked"
        return "valid" if self.valid(now) else "expired"


def new_key(random_hex: RandomHex) -> tuple[str, str, str]:
    """A new key, its id and its hash."""
    key_id, secret = random_hex(4), random_hex(KEY_BYTES)
    key = f"hek_{key_id}_{secret}"
    return key, key_id, hash_key(key)


def hash_key(key: str) -> str:
    """What is stored of a key, or of a session's token; both are random, so that a slow hash is not needed."""
    return hashlib.sha256(key.encode()).hexdigest()


def id_of(key: str) -> str | None:
    """The id within a key; None when the text does not have the form of a key."""
    found = KEY_PATTERN.fullmatch(key)
    return found[1] if found else None


def matches(key: str, stored_hash: str) -> bool:
    """True when `key` has this hash; compared in constant time."""
    return hmac.compare_digest(hash_key(key), stored_hash)
