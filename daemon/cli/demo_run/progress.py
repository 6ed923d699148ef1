"""Progress output of the demo: one line per step, rewritten on a terminal, written once elsewhere."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

import typer

NAME, WHAT = 12, 36
"""Widths of the two left columns."""


class ProgressLine:
    def __init__(self, name: str, what: str, live: bool, aside: bool) -> None:
        self._left = f"  {name:<{NAME}}{what:<{WHAT}}"
        self._live, self._aside = live, aside
        self._began_s = time.monotonic()
        self.over = False

    def update(self, doing: str) -> None:
        """Rewrite the line with the current activity; on a terminal only."""
        if self._live:
            typer.echo(f"\r\033[K{self._left}{doing}", nl=False, err=self._aside)

    def finish(self, result: str) -> None:
        """Complete the line with the time taken and the result."""
        self.over = True
        took = f"{time.monotonic() - self._began_s:5.1f} s"
        typer.echo(("\r\033[K" if self._live else "") + f"{self._left}{took}   {result}", err=self._aside)


class ProgressPrinter:
    """Prints to standard output, or with `aside` to standard error."""

    def __init__(self, aside: bool = False) -> None:
        self._aside = aside
        self._live = (sys.stderr if aside else sys.stdout).isatty()

    def line(self, text: str = "") -> None:
        typer.echo(text, err=self._aside)

    @contextmanager
    def progress_line(self, name: str, what: str) -> Iterator[ProgressLine]:
        """The progress line of a step; when the block raises, the line stays as it is."""
        step = ProgressLine(name, what, self._live, self._aside)
        step.update("...")
        try:
            yield step
        except BaseException:
            if self._live and not step.over:
                typer.echo(err=self._aside)
            raise
