"""API keys: 256 random bits, shown once, stored as SHA-256. A slow hash is not needed at that length.

A service has a key of its own group, made anew at each start, in a file that only root and that group can read. Whoever
reads it could make keys, read the store and write the settings anyway. Commands find it, curl takes it as
`-H @/run/handeyed/authorization`.
"""

import hashlib
import hmac
import os
import re
import secrets
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from daemon.runtime.durable_files import create_file
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


AUTHORIZATION = "authorization"
"""The file in the service's runtime folder: one header line, as curl reads it."""


@dataclass(frozen=True)
class ServiceKey:
    """The hash of the key; the key itself stands in the file only."""

    hash: str

    @classmethod
    def make(cls, folder: Path, random_hex: RandomHex = secrets.token_hex) -> "ServiceKey":
        """Make the key, and write its file into `folder`, readable by the folder's group. Raises OSError."""
        key, _, _ = new_key(random_hex)
        written = folder / f".{AUTHORIZATION}"
        with create_file(written) as out:
            os.fchmod(out.fileno(), 0o640)  # a service's umask leaves the group out
            out.write(f"Authorization: Bearer {key}\n".encode())
        written.replace(folder / AUTHORIZATION)
        return cls(hash_key(key))

    def opens(self, key: str) -> bool:
        """True when `key` is this key; compared in constant time."""
        return matches(key, self.hash)


def read_authorization(folder: Path) -> str | None:
    """The value of the header in the file below `folder`, "Bearer ..."; None when it is not there or not for us."""
    try:
        line = (folder / AUTHORIZATION).read_text(encoding="ascii")
    except (OSError, UnicodeError):
        return None
    return line.partition(":")[2].strip() or None
