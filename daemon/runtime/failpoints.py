"""Places where a crash would hurt, by name, so that a test can make one there. The product does nothing at them."""

from typing import Protocol


class Failpoints(Protocol):
    """Told of each place as it is reached; may raise, or end the process."""

    def reached(self, place: str) -> None: ...


class Never:
    """What the product is given."""

    def reached(self, place: str) -> None:
        """Goes on."""


NEVER = Never()

PLACES = (
    "before write",
    "before fsync",
    "after fsync",
    "before rename",
    "after rename",
    "before fsync of the folder",
    "after fsync of the folder",
    "before commit",
    "after commit",
    "before move",
    "after move",
    "before capture",
    "after capture",
)
"""Every one there is; the torture visits them all."""
