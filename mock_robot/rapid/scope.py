"""Symbols of a program: data, routines, types, and the scopes in which names are looked up."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from mock_robot.rapid.errors import RapidError, RapidProgramError
from mock_robot.rapid.types import Type

Frame = list[Any]
"""A routine's data while it runs: its result, then one slot per parameter and local name."""


class Slot:
    """Storage of a value."""

    __slots__ = ("value",)

    def __init__(self, value: Any) -> None:
        self.value = value

    def notify_change(self) -> None:
        """Note that a part of the value changed."""


class Persistent(Slot):
    """A PERS: shared by tasks; its watchers are called on every change."""

    __slots__ = ("_value", "name", "watchers")

    def __init__(self, value: Any, name: str = "") -> None:
        self._value, self.name = value, name
        self.watchers: tuple[Callable[[], None], ...] = ()

    @property
    def value(self) -> Any:
        return self._value

    @value.setter
    def value(self, value: Any) -> None:
        changed, self._value = value != self._value, value
        if changed:
            self.notify_change()

    def notify_change(self) -> None:
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
        self._root.notify_change()

    def notify_change(self) -> None:
        self._root.notify_change()


@dataclass(frozen=True)
class Data:
    """A data object: in `slot`, or at `place` of its routine's frame. `storage`: const, pers, var, loop."""

    name: str
    type: Type
    storage: str
    slot: Slot | None = None
    place: int = 0
    optional: bool = False


@dataclass(frozen=True)
class Parameter:
    """One parameter. `mode`: in, var, pers, inout. At most one of those sharing an `alternative` may be given."""

    name: str
    type: Type
    mode: str = "in"
    optional: bool = False
    alternative: int = 0


@dataclass
class Routine:
    """A routine of a module; `body` is set by the compiler. `kind`: proc, func, trap.

    `listed`: the numbers in ERROR (...), the only errors its handler takes; () for a handler of any error.
    """

    name: str
    kind: str
    parameters: tuple[Parameter, ...]
    result: Type | None
    where: str
    places: int = 0
    body: Callable[[Frame], Any] | None = None
    handler: Callable[[Frame], Any] | None = None
    listed: tuple[Callable[[Frame], float], ...] = ()


@dataclass(frozen=True)
class Builtin:
    """An instruction or function of the controller: header and implementation, which `left_out` is not passed to."""

    name: str
    kind: str
    parameters: tuple[Parameter, ...]
    result: Type | None
    does: Callable[..., Any] = field(compare=False)
    left_out: frozenset[str] = frozenset()


Symbol = Data | Routine | Builtin


@dataclass
class Scope:
    """Names of one level, and the enclosing scope."""

    outer: "Scope | None" = None
    symbols: dict[str, Symbol] = field(default_factory=dict)
    types: dict[str, Type] = field(default_factory=dict)

    def find(self, name: str) -> Symbol | None:
        return self.symbols.get(name) or (self.outer.find(name) if self.outer else None)

    def find_type(self, name: str) -> Type | None:
        return self.types.get(name) or (self.outer.find_type(name) if self.outer else None)

    def declare(self, symbol: Symbol, module: str, line: int) -> None:
        """Add a name; raises RapidProgramError if it exists at this level."""
        if symbol.name in self.symbols:
            raise RapidProgramError(module, line, f"{symbol.name} is declared twice")
        self.symbols[symbol.name] = symbol


@dataclass(frozen=True)
class ErrorNumbers:
    """Error names and numbers as a program sees them; ERRNO has the number of the last error handled."""

    numbers: Mapping[str, float]
    errno: Slot

    def number_of(self, error: RapidError) -> float:
        """Number of an error as a program sees it; 0 for one without."""
        return self.numbers.get(error.name, 0.0) if error.number is None else error.number

    def error_of(self, number: float) -> RapidError:
        """The error that a program raises by number."""
        found = next((name for name, known in self.numbers.items() if known == number), None)
        return RapidError(found or f"error {number:g}", "raised by the program", number)


@dataclass
class CompileContext:
    """Compile-time context of a statement: task, module, scope and routine.

    `call` compiles a call of a routine: handed in because a call's arguments are expressions, and a call is one.
    `labels` are those that a GOTO may name here: of its block and those around it.
    """

    task: Any
    module: str
    scope: Scope
    errors: "ErrorNumbers"
    call: "CompileCall"
    routine: Routine | None = None
    in_handler: bool = False
    labels: frozenset[str] = frozenset()

    def wrong(self, line: int, why: str) -> RapidProgramError:
        return RapidProgramError(self.module, line, why)

    def require_type(self, name: str, line: int) -> Type:
        """The type of that name; raises RapidProgramError for an unknown one."""
        found = self.scope.find_type(name)
        if found is None:
            raise self.wrong(line, f"no type is named {name}")
        return found

    def local(self, name: str, kind: Type, storage: str, line: int, optional: bool = False) -> Data:
        """Declare a name in the routine's frame."""
        assert self.routine is not None
        self.routine.places += 1
        data = Data(name, kind, storage, place=self.routine.places, optional=optional)
        self.scope.declare(data, self.module, line)
        return data


CompileCall = Callable[[CompileContext, Routine | Builtin, Any], Callable[[Frame], Any]]
"""From the context, what is called and the node of the call to what evaluates it in a frame."""
