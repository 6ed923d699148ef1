"""RAPID data types: atoms, records and arrays, with their initial values and copying."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from mock_robot.rapid.values import RawBytes, StopWatch


@dataclass(frozen=True)
class Atom:
    """A type without parts. `initial` makes the value of a VAR without one; a `device` cannot be assigned."""

    name: str
    initial: Callable[[], Any] = field(compare=False)
    device: bool = False

    def copy(self, value: Any) -> Any:
        """A copy of the value; atoms are immutable."""
        return value


@dataclass(frozen=True)
class Record:
    """Named components in order; a value is the list of their values."""

    name: str
    components: tuple[tuple[str, "Type"], ...]

    def initial(self) -> list[Any]:
        return [kind.initial() for _, kind in self.components]

    def copy(self, value: list[Any]) -> list[Any]:
        return [kind.copy(item) for (_, kind), item in zip(self.components, value, strict=True)]

    def place(self, component: str) -> int | None:
        """Index of a component; None when there is none of that name."""
        return next((place for place, (name, _) in enumerate(self.components) if name == component), None)

    @property
    def parts(self) -> tuple["Type", ...]:
        return tuple(kind for _, kind in self.components)


OPEN = -1
"""Length of the array of a parameter `{*}`, which takes one of any length."""


@dataclass(frozen=True)
class Array:
    """`length` elements, counted from 1."""

    element: "Type"
    length: int

    @property
    def name(self) -> str:
        return f"{self.element.name}{{{self.length}}}"

    @property
    def parts(self) -> tuple["Type", ...]:
        return (self.element,) * max(self.length, 0)

    def initial(self) -> list[Any]:
        return [self.element.initial() for _ in range(self.length)]

    def copy(self, value: list[Any]) -> list[Any]:
        return [self.element.copy(item) for item in value]


Type = Atom | Record | Array


class Nothing:
    """Value of a device that no instruction here uses."""


NUM = Atom("num", float)
DNUM = Atom("dnum", float)
BYTE = Atom("byte", int)
BOOL = Atom("bool", bool)
STRING = Atom("string", str)
RAWBYTES = Atom("rawbytes", RawBytes, device=True)
CLOCK = Atom("clock", StopWatch, device=True)
SIGNAL_KINDS = ("DI", "DO", "GI", "GO", "AI", "AO")
SIGNAL_TYPES = {kind: Atom(f"signal{kind.lower()}", Nothing, device=True) for kind in SIGNAL_KINDS}
"""By SignalType of EIO.cfg."""
ANYTYPE = Atom("anytype", Nothing)
CONDITION = Atom("condition", Nothing)
SWITCH = Atom("switch", Nothing)

ATOMS = (
    *(NUM, DNUM, BYTE, BOOL, STRING, RAWBYTES, CLOCK, *SIGNAL_TYPES.values(), ANYTYPE, CONDITION, SWITCH),
    *(Atom(name, Nothing, device=True) for name in ("trapdata", "mecunit", "egmident", "taskid")),
)
