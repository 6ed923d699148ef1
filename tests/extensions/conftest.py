"""The running daemon of the daemon's tests: it serves what every extension adds."""

from tests.daemon.cli.conftest import solved
from tests.daemon.conftest import bench

__all__ = ["bench", "solved"]
