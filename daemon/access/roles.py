"""The roles viewer, operator and admin; each includes the rights of those before it."""

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
