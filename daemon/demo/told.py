"""How the demo talks: one line a step, rewritten on a terminal while it goes on, written once elsewhere."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

import typer

NAME, WHAT = 12, 36
"""Widths of the two left columns."""


class Step:
    """A step that is being taken."""

    def __init__(self, name: str, what: str, live: bool) -> None:
        self._left = f"  {name:<{NAME}}{what:<{WHAT}}"
        self._live = live
        self._began_s = time.monotonic()
        self.over = False

    def now(self, doing: str) -> None:
        """What goes on; seen on a terminal only."""
        if self._live:
            typer.echo(f"\r\033[K{self._left}{doing}", nl=False)

    def done(self, result: str) -> None:
        """How it ended."""
        self.over = True
        took = f"{time.monotonic() - self._began_s:5.1f} s"
        typer.echo(("\r\033[K" if self._live else "") + f"{self._left}{took}   {result}")


class Teller:
    """Writes to standard output."""

    def __init__(self) -> None:
        self._live = sys.stdout.isatty()

    def line(self, text: str = "") -> None:
        typer.echo(text)

    @contextmanager
    def step(self, name: str, what: str) -> Iterator[Step]:
        """A step; when it fails the line is left as it stands, and the error follows on its own."""
        step = Step(name, what, self._live)
        step.now("...")
        try:
            yield step
        except BaseException:
            if self._live and not step.over:
                typer.echo()
            raise
