"""Sessions of browsers: a key exchanged for a cookie, whose random token is stored as SHA-256."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import datetime, timedelta

from daemon.access.keys import KeyRecord
from daemon.access.roles import ROLES, Caller, Role

TOKEN_BYTES = 32
TOKEN = re.compile(r"[A-Za-z0-9_-]{43}")
"""TOKEN_BYTES as base64url without padding."""

MAX_SESSION_S = 12 * 3600
"""A session ends after this, however it is used: one shift."""

MAX_SESSIONS_PER_KEY = 50
"""The oldest session of a key is ended for one more."""

RandomToken = Callable[[int], str]
"""Returns n random bytes as base64url, like `secrets.token_urlsafe`."""


@dataclass(frozen=True)
class BrowserSession:
    """The stored record of a session. `role`: at most this one; `touched_at`: when somebody last acted at the screen.

    `paired`: it was begun with a pairing code; `parent`: hash of the session that made the code, with which this one
    ends, None for a code made with a key. Times are ISO timestamps in UTC.
    """

    hash: str
    key_id: str
    role: str
    created_at: str
    expires_at: str
    touched_at: str
    peer: str
    paired: bool
    parent: str | None = None

    @property
    def id(self) -> str:
        """A short name of the session, for the audit log: it opens nothing."""
        return self.hash[:8]

    def valid(self, now: str) -> bool:
        """True until it expires; its key's end ends it, too."""
        return now < self.expires_at

    def caller(self, key: KeyRecord, idle_since: str) -> Caller:
        """Who asks: with the lower role of session and key; a viewer when last touched before `idle_since`."""
        role = min(ROLES[key.role], ROLES[self.role])
        if self.touched_at < idle_since:
            role = Role.VIEWER
        return Caller(key.name, role, key.id, self.id)

    def limited_by(self, owner: "KeyRecord | BrowserSession") -> "BrowserSession":
        """The session, which ends with its key, or its parent, at the latest."""
        if owner.expires_at is None or owner.expires_at > self.expires_at:
            return self
        return replace(self, expires_at=owner.expires_at)


def cookie_name(scheme: str) -> str:
    """The cookie's name: over TLS with the prefix that browsers accept from this host and with Secure only."""
    return "__Host-handeyed" if scheme == "https" else "handeyed"


def cookie_of(scheme: str, token: str, max_age_s: int) -> str:
    """The Set-Cookie header of a session; with an empty token and 0 s the one that removes it."""
    secure = "; Secure" if scheme == "https" else ""
    return f"{cookie_name(scheme)}={token}; Path=/; HttpOnly; SameSite=Strict; Max-Age={max_age_s}{secure}"


def token_in(cookies: str, scheme: str) -> str | None:
    """The token in a Cookie header; None without one of its form."""
    for part in cookies.split(";"):
        name, _, value = part.strip().partition("=")
        if name == cookie_name(scheme) and TOKEN.fullmatch(value):
            return value
    return None


def timestamp_of(moment: datetime, seconds: float = 0.0) -> str:
    """`moment` (UTC), shifted, as ISO 8601 with milliseconds: comparable as text."""
    shifted = moment + timedelta(seconds=seconds)
    return shifted.isoformat(timespec="milliseconds").replace("+00:00", "Z")
