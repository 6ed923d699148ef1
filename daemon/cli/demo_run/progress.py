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

    def __init__(self, name: str, what: str, live: bool, aside: bool) -> None:
        self._left = f"  {name:<{NAME}}{what:<{WHAT}}"
        self._live, self._aside = live, aside
        self._began_s = time.monotonic()
        self.over = False

    def now(self, doing: str) -> None:
        """What goes on; seen on a terminal only."""
        if self._live:
            typer.echo(f"\r\033[K{self._left}{doing}", nl=False, err=self._aside)

    def done(self, result: str) -> None:
        """How it ended."""
        self.over = True
        took = f"{time.monotonic() - self._began_s:5.1f} s"
        typer.echo(("\r\033[K" if self._live else "") + f"{self._left}{took}   {result}", err=self._aside)


class Teller:
    """Writes to standard output; `aside`, to standard error, when the output is for programs."""

    def __init__(self, aside: bool = False) -> None:
        self._aside = aside
        self._live = (sys.stderr if aside else sys.stdout).isatty()

    def line(self, text: str = "") -> None:
        typer.echo(text, err=self._aside)

    @contextmanager
    def step(self, name: str, what: str) -> Iterator[Step]:
        """A step; when it fails the line is left as it stands, and the error follows on its own."""
        step = Step(name, what, self._live, self._aside)
        step.now("...")
        try:
            yield step
        except BaseException:
            if self._live and not step.over:
                typer.echo(err=self._aside)
            raise
