"""What names stand for: data in their slots, routines, types; and where a name is looked up."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from mock_robot.rapid.errors import RapidError, RapidProgramError
from mock_robot.rapid.types import Type

Frame = list[Any]
"""A routine's data while it runs: its result, then a slot for each parameter and local name."""


class Slot:
    """Where a value is kept."""

    __slots__ = ("value",)

    def __init__(self, value: Any) -> None:
        self.value = value

    def touched(self) -> None:
        """A part of the value has changed."""


class Persistent(Slot):
    """A PERS: shared by tasks, and whoever asked for it hears of every change."""

    __slots__ = ("_value", "watchers")

    def __init__(self, value: Any) -> None:
        self._value = value
        self.watchers: tuple[Callable[[], None], ...] = ()

    @property
    def value(self) -> Any:
        return self._value

    @value.setter
    def value(self, value: Any) -> None:
        changed, self._value = value != self._value, value
        if changed:
            self.touched()

    def touched(self) -> None:
        for notice in self.watchers:
            notice()


class Part:
    """A component of a record or an element of an array, passed by reference."""

    __slots__ = ("_owner", "_place", "_root")

    def __init__(self, owner: list[Any], place: int, root: Slot) -> None:
        self._owner, self._place, self._root = owner, place, root

    @property
    def value(self) -> Any:
        return self._owner[self._place]

    @value.setter
    def value(self, value: Any) -> None:
        self._owner[self._place] = value
        self._root.touched()

    def touched(self) -> None:
        self._root.touched()


@dataclass(frozen=True)
class Data:
    """A data object: in `slot`, or at `place` of the frame of its routine. `storage`: const, pers, var, loop."""

    name: str
    type: Type
    storage: str
    slot: Slot | None = None
    place: int = 0
    optional: bool = False


@dataclass(frozen=True)
class Parameter:
    """One parameter. `mode`: in, var, pers, inout. Of those that share an `alternative` only one may be given."""

    name: str
    type: Type
    mode: str = "in"
    optional: bool = False
    alternative: int = 0
    open_array: bool = False


@dataclass
class Routine:
    """A routine of a module; `body` is set when it is compiled. `kind`: proc, func, trap."""

    name: str
    kind: str
    parameters: tuple[Parameter, ...]
    result: Type | None
    where: str
    places: int = 0
    body: Callable[[Frame], Any] | None = None
    handler: Callable[[Frame], Any] | None = None


@dataclass(frozen=True)
class Builtin:
    """An instruction or a function of the controller: its header, and what does it."""

    name: str
    kind: str
    parameters: tuple[Parameter, ...]
    result: Type | None
    does: Callable[..., Any] = field(compare=False)


Symbol = Data | Routine | Builtin


@dataclass
class Scope:
    """Names of one level, and the level around it."""

    outer: "Scope | None" = None
    symbols: dict[str, Symbol] = field(default_factory=dict)
    types: dict[str, Type] = field(default_factory=dict)

    def find(self, name: str) -> Symbol | None:
        """What the name stands for here; None when it is unknown."""
        scope: Scope | None = self
        while scope is not None:
            if name in scope.symbols:
                return scope.symbols[name]
            scope = scope.outer
        return None

    def type_named(self, name: str) -> Type | None:
        """The type of that name; None when it is unknown."""
        scope: Scope | None = self
        while scope is not None:
            if name in scope.types:
                return scope.types[name]
            scope = scope.outer
        return None

    def declare(self, symbol: Symbol, module: str, line: int) -> None:
        """A new name; raises RapidProgramError for one that exists at this level."""
        if symbol.name in self.symbols:
            raise RapidProgramError(module, line, f"{symbol.name} is declared twice")
        self.symbols[symbol.name] = symbol


@dataclass(frozen=True)
class ErrorNumbers:
    """Names of errors and the numbers a program sees; ERRNO has that of the last one that was handled."""

    numbers: Mapping[str, float]
    errno: Slot

    def note(self, error: RapidError) -> None:
        """It is handled now."""
        self.errno.value = self.numbers.get(error.name, 0.0)

    def numbered(self, number: float) -> RapidError:
        """The error a program raises by its number."""
        found = next((name for name, known in self.numbers.items() if known == number), None)
        return RapidError(found or f"error {number:g}", "raised by the program")


@dataclass
class Context:
    """Where a piece of a program stands: what it is compiled against. `task` runs it."""

    task: Any
    module: str
    scope: Scope
    errors: "ErrorNumbers"
    routine: Routine | None = None
    in_handler: bool = False

    def wrong(self, line: int, why: str) -> RapidProgramError:
        """The error to raise for a line."""
        return RapidProgramError(self.module, line, why)

    def type_named(self, name: str, line: int) -> Type:
        """A type; raises RapidProgramError for an unknown one."""
        found = self.scope.type_named(name)
        if found is None:
            raise self.wrong(line, f"no type is named {name}")
        return found

    def local(self, name: str, kind: Type, storage: str, line: int, optional: bool = False) -> Data:
        """A new name in the routine's frame."""
        assert self.routine is not None
        self.routine.places += 1
        data = Data(name, kind, storage, place=self.routine.places, optional=optional)
        self.scope.declare(data, self.module, line)
        return data
