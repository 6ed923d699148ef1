"""Named places where tests inject a crash. In the product they do nothing."""

from collections.abc import Callable

Failpoints = Callable[[str], None]
"""Called at each place; a test's may raise or end the process."""

NO_FAILPOINTS: Failpoints = lambda place: None  # noqa: E731

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
