"""Named places where tests inject a crash. In the product they do nothing."""

from typing import Protocol


class Failpoints(Protocol):
    """Called at each place; a test's implementation may raise or end the process."""

    def reach(self, place: str) -> None: ...


class NoFailpoints:
    """The product's implementation."""

    def reach(self, place: str) -> None: ...


NO_FAILPOINTS = NoFailpoints()

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
"""All places; `benchmarks.daemon.torture` crashes at each of them."""
