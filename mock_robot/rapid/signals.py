"""Signals of a controller: set by programs, by tests, or mirroring a system output."""

from collections.abc import Callable
from typing import Any

from mock_robot.rapid.errors import RapidError

DIGITAL = ("DI", "DO")


class Signal:
    """A signal of EIO.cfg. `kind`: DI, DO, GI, GO, AI or AO. `source`: what it mirrors; programs only read it then.

    A digital one is a bool, the others are numbers; `value` is its state, without a source's. `written`: a remote
    client may write it (-Access "All").
    """

    def __init__(
        self, name: str, kind: str, source: Callable[[], bool] | None = None, written: bool = False, place: str = ""
    ) -> None:
        self.name, self.kind, self.source, self.written, self.place = name, kind, source, written, place
        self.value: Any = False if kind in DIGITAL else 0.0

    def read(self) -> Any:
        return self.value if self.source is None else self.source()


def signal_of(value: Any) -> Signal:
    """The signal behind a name. Raises ERR_NO_ALIASIO_DEF for one that AliasIO has not connected."""
    if not isinstance(value, Signal):
        raise RapidError("ERR_NO_ALIASIO_DEF", "the signal was declared, but AliasIO has not connected it")
    return value


def number_of(value: Any) -> float:
    """Number of a signal as an expression has it."""
    return float(signal_of(value).read())
