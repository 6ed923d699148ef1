"""What a link tells its shell to do, step by step. A shell is a socket, a serial line, or a test's list."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Send:
    """Put these bytes on the wire."""

    data: bytes


@dataclass(frozen=True)
class Pause:
    """Let real time pass."""

    seconds: float


@dataclass(frozen=True)
class Close:
    """Close the connection in good order; a serial line stays open."""


@dataclass(frozen=True)
class Reset:
    """Break the connection: the peer sees a reset. A serial line stays open."""


WireStep = Send | Pause | Close | Reset
