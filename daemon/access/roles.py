"""The roles viewer, operator and admin, each with the rights of those before it; and which one a request requires."""

from dataclasses import dataclass
from enum import IntEnum

from daemon.access.actor_names import LOCAL_CLIENT, SERVICE_GROUP


class Role(IntEnum):
    """Viewers read, operators run the cell, admins also manage keys and read the audit log."""

    NOBODY = 0
    VIEWER = 1
    OPERATOR = 2
    ADMIN = 3

    @property
    def word(self) -> str:
        return self.name.lower()


ROLES = {role.word: role for role in Role if role is not Role.NOBODY}


@dataclass(frozen=True)
class Caller:
    """Name and role of the client that makes a request, its key's id and its browser session's; empty when unknown."""

    name: str
    role: Role
    key_id: str = ""
    session: str = ""


LOCAL = Caller(LOCAL_CLIENT, Role.ADMIN)
"""The caller of every request from this machine while no keys exist, of a daemon that is no service."""

LOCAL_READER = Caller(LOCAL_CLIENT, Role.VIEWER)
"""The same of a service: whoever has an account may look, and only the service's group may move the arm."""

SERVICE = Caller(SERVICE_GROUP, Role.ADMIN)
"""Who asks with the key in the service's runtime folder: root, the daemon's user, or one of its group."""

NOBODY = Caller("", Role.NOBODY)


ANY = "*"

POLICY: tuple[tuple[str, str, Role], ...] = (
    ("GET", "/health", Role.NOBODY),  # for monitors; discloses nothing
    ("POST", "/setup", Role.NOBODY),  # protected by the set-up code in the log
    ("POST", "/session", Role.NOBODY),  # protected by the key or the pairing code in it
    ("GET", "/session", Role.NOBODY),  # who is signed in, and what is asked for
    ("DELETE", "/session", Role.NOBODY),  # ends the caller's own
    ("POST", "/session/touch", Role.VIEWER),
    ("GET", "/docs/*", Role.NOBODY),  # static files
    ("GET", "/page/*", Role.NOBODY),  # static files; the page asks for a key itself
    ("GET", "/audit", Role.ADMIN),
    ("GET", "/audit/verified", Role.ADMIN),
    ("GET", "/keys", Role.ADMIN),
    ("POST", "/keys", Role.ADMIN),
    ("POST", "/keys/*", Role.ADMIN),
    ("GET", "/settings", Role.ADMIN),
    ("POST", "/support-bundle", Role.ADMIN),
    ("GET", "/setup", Role.ADMIN),
    ("PUT", "/setup", Role.ADMIN),
    (ANY, "/setup/*", Role.ADMIN),
    ("GET", ANY, Role.VIEWER),
    ("OPTIONS", ANY, Role.VIEWER),
    (ANY, ANY, Role.OPERATOR),
)
"""Method, path, and the role that such a request requires: the first matching row decides."""


def role_for(method: str, path: str) -> Role:
    """The lowest role that may make this request."""
    return next(
        role
        for verb, place, role in POLICY
        if verb in (method, ANY)
        and (place in (path, ANY) or (place.endswith("/*") and path.startswith(place[:-1])))  # /page/*: what is in it
    )
