"""The console script `handeyed`."""

from daemon.cli.main import main

__all__ = ["main"]
