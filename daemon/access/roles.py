"""Three roles, each may do what the ones before it may."""

from dataclasses import dataclass
from enum import IntEnum


class Role(IntEnum):
    """Who may look, who may work, who may decide who may."""

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
    """Whoever asks: by name, as far as it is known, and in which role."""

    name: str
    role: Role


LOCAL = Caller("local", Role.ADMIN)
"""Whoever is on this machine, while there are no keys."""

NOBODY = Caller("", Role.NOBODY)
