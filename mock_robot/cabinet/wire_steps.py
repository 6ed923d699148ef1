"""Output steps of a link, carried out by a socket, a serial line or a test."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Send:
    data: bytes


@dataclass(frozen=True)
class Pause:
    """Wait in real time."""

    seconds: float


@dataclass(frozen=True)
class Close:
    """Close the connection in order; a serial line stays open."""


@dataclass(frozen=True)
class Reset:
    """Reset the connection (TCP RST); a serial line stays open."""


WireStep = Send | Pause | Close | Reset
