"""Digital signals of a controller: set by programs, by tests, or mirroring a system output."""

from collections.abc import Callable
from dataclasses import dataclass


@dataclass
class DigitalSignal:
    """A signal of EIO.cfg; `kind` is DI or DO. `source`: the system output it mirrors."""

    name: str
    kind: str
    source: Callable[[], bool] | None = None
    value: bool = False

    def read(self) -> bool:
        """Its state now."""
        return self.value if self.source is None else self.source()
