"""Data types of RAPID: atoms, records and arrays, each with its initial value and its way of being copied."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from mock_robot.rapid.values import Clock, RawBytes


@dataclass(frozen=True)
class Atom:
    """A type without parts. `fresh` makes its initial value; a `device` has no value that could be assigned."""

    name: str
    fresh: Callable[[], Any] = field(compare=False)
    device: bool = False

    def initial(self) -> Any:
        """What a VAR holds that was given nothing."""
        return self.fresh()

    def copy(self, value: Any) -> Any:
        """A value of one's own: those of atoms never change."""
        return value


@dataclass(frozen=True)
class Record:
    """Named parts in order; a value is the list of theirs."""

    name: str
    components: tuple[tuple[str, "Type"], ...]

    def initial(self) -> list[Any]:
        """Every part as a VAR that was given nothing."""
        return [kind.initial() for _, kind in self.components]

    def copy(self, value: list[Any]) -> list[Any]:
        """A value of one's own."""
        return [kind.copy(item) for (_, kind), item in zip(self.components, value, strict=True)]

    def place(self, component: str) -> int | None:
        """Where a part lies; None when there is none of that name."""
        return next((place for place, (name, _) in enumerate(self.components) if name == component), None)

    @property
    def parts(self) -> tuple["Type", ...]:
        """The types of the parts."""
        return tuple(kind for _, kind in self.components)


@dataclass(frozen=True)
class Array:
    """`length` elements, counted from 1."""

    element: "Type"
    length: int

    @property
    def name(self) -> str:
        """As a message names it."""
        return f"{self.element.name}{{{self.length}}}"

    @property
    def parts(self) -> tuple["Type", ...]:
        """The types of the elements."""
        return (self.element,) * self.length

    def initial(self) -> list[Any]:
        """Every element as a VAR that was given nothing."""
        return [self.element.initial() for _ in range(self.length)]

    def copy(self, value: list[Any]) -> list[Any]:
        """A value of one's own."""
        return [self.element.copy(item) for item in value]


Type = Atom | Record | Array


class Nothing:
    """The value of a device that belongs to no instruction here."""


NUM = Atom("num", float)
DNUM = Atom("dnum", float)
BYTE = Atom("byte", int)
BOOL = Atom("bool", bool)
STRING = Atom("string", str)
RAWBYTES = Atom("rawbytes", RawBytes, device=True)
CLOCK = Atom("clock", Clock, device=True)
SIGNALDO = Atom("signaldo", Nothing, device=True)
ANYTYPE = Atom("anytype", Nothing)
CONDITION = Atom("condition", Nothing)
SWITCH = Atom("switch", Nothing)

ATOMS = (NUM, DNUM, BYTE, BOOL, STRING, RAWBYTES, CLOCK, SIGNALDO, ANYTYPE, CONDITION, SWITCH)
