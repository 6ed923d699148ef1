"""The program of one task: declares, checks and compiles its modules; and the PERS that outlive it."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

from mock_robot.rapid.calls import call
from mock_robot.rapid.devices import DEVICES
from mock_robot.rapid.errors import CycleLeft, LongJump, ProgramStopped, RaisedFurther, RapidProgramError
from mock_robot.rapid.expressions import expression
from mock_robot.rapid.instructions.table import DOES, LEFT_OUT
from mock_robot.rapid.scope import (
    Builtin,
    CompileContext,
    Data,
    ErrorNumbers,
    Frame,
    Parameter,
    Persistent,
    Routine,
    Scope,
    Slot,
)
from mock_robot.rapid.signals import Signal
from mock_robot.rapid.statements import Run, block
from mock_robot.rapid.symbols import LiveSymbol
from mock_robot.rapid.syntax import Node, line_of, name, optional_part, parse_module, parse_system, part, parts
from mock_robot.rapid.tasks import EXECUTION_ERROR, ProgramTask
from mock_robot.rapid.types import ATOMS, NUM, OPEN, SIGNAL_TYPES, Array, Record, Type


@dataclass(frozen=True)
class Source:
    """A module's file. `shared`: loaded once for all tasks."""

    name: str
    text: str
    shared: bool = False


@dataclass
class PersistentMemory:
    """PERS of a controller: shared by its tasks, kept over a restart."""

    _kept: dict[str, tuple[Type, Persistent]] = field(default_factory=dict)

    def slot(self, key: str, kind: Type, initial: Callable[[], Any]) -> Persistent:
        """The PERS of that name; `initial` is called when none of this type exists yet."""
        known = self._kept.get(key)
        if known is None or known[0] != kind:
            known = self._kept[key] = (kind, Persistent(initial(), key))
        return known[1]

    def __getitem__(self, key: str) -> Persistent:
        return self._kept[key][1]

    def find(self, key: str) -> Persistent | None:
        return self._kept[key][1] if key in self._kept else None

    def symbol(self, key: str) -> LiveSymbol | None:
        return LiveSymbol(*self._kept[key]) if key in self._kept else None

    def preset(self, key: str, value: Any) -> None:
        """Set a PERS before the module is loaded, as an integrator edits it; the type comes from the existing value."""
        kind, slot = self._kept[key]
        slot.value = kind.copy(value)


@dataclass
class Program:
    """All modules of a task."""

    task: ProgramTask
    memory: PersistentMemory
    signals: Mapping[str, Signal]
    scope: Scope = field(init=False)
    errors: ErrorNumbers = field(init=False)
    _scopes: dict[str, Scope] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        self.scope = Scope(types=dict(system_types()))
        self.errors = ErrorNumbers({}, Slot(0.0))
        for builtin in builtins():
            self.scope.symbols[builtin.name] = builtin
        context = self._context(SYSTEM)
        for node in parts(parse_system(), "data"):
            self._declare_data(context, node)
        symbols = {each.name: each for each in self.scope.symbols.values() if isinstance(each, Data)}
        numbers = {n.upper(): d.slot.value for n, d in symbols.items() if n.startswith("err_") and d.slot is not None}
        errno = symbols["errno"].slot
        assert errno is not None
        self.errors = ErrorNumbers(numbers, errno)
        settings = symbols["c_motset"]
        self.scope.symbols["c_motset"] = replace(settings, storage="read only")
        self.task.settings = settings.slot
        for signal, device in self.signals.items():
            kind = SIGNAL_TYPES[device.kind]
            self.scope.symbols[signal.casefold()] = Data(signal.casefold(), kind, "var", Slot(device))
        self.scope = Scope(self.scope)

    def load(self, sources: Sequence[Source], only: Source | None = None) -> None:
        """Declare every module, then compile every routine, or those of `only`.

        Raises RapidSyntaxError, RapidProgramError.
        """
        loaded = [(source, parse_module(source.text, source.name)) for source in sources]
        pending: list[tuple[CompileContext, Routine, Node]] = []
        declare_types([(self._context(source.name), module) for source, module in loaded], self.scope)
        for source, module in loaded:
            context = self._context(source.name)
            for node in parts(module):
                local = node.data == "local"
                inner = part(node, 1) if local else node
                if inner.data in ("proc", "func", "trap"):
                    is_looked_at = (
                        only is None or source is only
                    )  # of others, what is declared a second time is left out
                    with nullcontext() if is_looked_at else suppress(RapidProgramError):
                        pending.append((context, self._declare_routine(context, inner, local), inner))
        waiting = [(source, node) for source, module in loaded for node in parts(module, "data")]
        while waiting:  # a value may be made of one that a later module declares
            waiting = self._declare_all(waiting, only)
        for context, routine, node in pending:
            if only is None or context.module == only.name:
                _compile(context, routine, node)

    def _declare_all(self, waiting: list[tuple[Source, Node]], only: Source | None) -> list[tuple[Source, Node]]:
        """Declare data; returns what could not be yet. Raises RapidProgramError when that is everything."""
        left, first = [], None
        for source, node in waiting:
            try:
                self._declare_data(self._context(source.name), node, shared=source.shared)
            except RapidProgramError as error:
                if only is not None and source is not only and "declared twice" in str(error):
                    continue
                first = first or error
                left.append((source, node))
        if first is not None and len(left) == len(waiting):
            if only is None or any(source is only for source, _ in left):
                raise first
            return []
        return left

    def main(self) -> Callable[[], None]:
        """Function that runs procedure main once. Raises RapidProgramError when there is none."""
        main = self.scope.find("main")
        if not isinstance(main, Routine) or main.kind != "proc" or main.parameters:
            raise RapidProgramError(self.task.name, 0, "no module of this task has a PROC main()")

        def run() -> None:
            assert main.body is not None
            try:
                main.body([None] * (main.places + 1))
            except RaisedFurther as raised:
                error = raised.error
                raise ProgramStopped(EXECUTION_ERROR, error.where, f"{error}, raised out of main") from error

        return run

    def _context(self, module: str) -> CompileContext:
        """With a scope of its own for the module's LOCAL names, which hide those of the task."""
        scope = self._scopes.setdefault(module, Scope(self.scope))
        return CompileContext(self.task, module, scope, self.errors, call)

    def _declare_routine(self, context: CompileContext, node: Node, local: bool) -> Routine:
        function = node.data == "func"
        place = int(function)
        parameters = () if node.data == "trap" else parameters_of(context, optional_part(node, place + 1))
        result = context.require_type(name(node, 0), line_of(node)) if function else None
        where = f"{context.module}:{line_of(node)}"
        routine = Routine(name(node, place), str(node.data), parameters, result, where)
        (context.scope if local else self.scope).declare(routine, context.module, line_of(node))
        return routine

    def _declare_data(self, context: CompileContext, node: Node, shared: bool = False) -> None:
        storage, called, line = name(node, 1), name(node, 3), line_of(node)
        reach = "" if node.children[0] is None else name(node, 0)
        kind, initial = _type_and_initial(context, node)
        if storage == "var" and shared:
            raise context.wrong(line, f"VAR {called} in a shared module: only PERS and CONST are shared here")
        if storage != "var" and initial is None and (storage == "const" or reach):
            raise context.wrong(line, f"{storage.upper()} {called} needs an initial value")

        def value() -> Any:
            return kind.initial() if initial is None else kind.copy(initial([None]))

        if storage == "pers":
            within = {"local": f"{self.task.name}/{context.module}/", "task": f"{self.task.name}/"}.get(reach, "")
            slot: Slot = self.memory.slot(within + called, kind, value)
        else:
            slot = Slot(value())
        if storage != "var" and kind.name == "socketdev":
            raise context.wrong(line, f"{called} is a socketdev, which can be VAR only")
        scope = context.scope if reach == "local" else self.scope
        scope.declare(Data(called, kind, storage, slot), context.module, line)


def _type_and_initial(context: CompileContext, node: Node) -> tuple[Type, Run | None]:
    """Parts of a declaration: REACH, STORAGE, type, name, up to three dimensions, initial value of constants."""
    kind: Type = context.require_type(name(node, 2), line_of(node))
    initial = optional_part(node, -1)
    dimensions = parts(node) if initial is None else parts(node)[:-1]
    if len(dimensions) > 3:
        raise context.wrong(line_of(node), f"{name(node, 3)} has {len(dimensions)} dimensions, an array at most three")
    for each in [] if initial is None else initial.find_pred(lambda inner: inner.data in ("function", "target")):
        found = context.scope.find(name(each, 0))
        if not (isinstance(found, Data) and found.storage == "const") and found is not None:
            raise context.wrong(
                line_of(node), f"the initial value of {name(node, 3)} is not of constants: {found.name}"
            )
    for dimension in reversed(dimensions):
        kind = Array(kind, int(expression(context, dimension, NUM).evaluate([None])))
    return kind, None if initial is None else expression(context, initial, kind).evaluate


_STORAGE_OF_MODE = {"in": "var", "var": "var", "inout": "var", "pers": "pers"}


def _compile(context: CompileContext, routine: Routine, node: Node) -> None:
    """Compile body, handler and UNDO of a routine."""
    inner = replace(context, scope=Scope(context.scope), routine=routine)
    for parameter in routine.parameters:
        storage = _STORAGE_OF_MODE[parameter.mode]
        inner.local(parameter.name, parameter.type, storage, line_of(node), parameter.optional)
    body = parts(node, "body")[0]
    locals_ = [_local(inner, data) for data in parts(body, "data")]
    statements = block(inner, [each for each in parts(body) if each.data != "data"])
    inner.in_handler = True
    for handler in parts(node, "error"):
        *numbers, statements_of_handler = parts(handler)
        routine.listed = tuple(expression(inner, number, NUM).evaluate for number in numbers)
        routine.handler = block(inner, parts(statements_of_handler))
    undo = [block(inner, parts(part(each, 0))) for each in parts(node, "undo")]

    def run(frame: Frame) -> Any:
        for place, make in locals_:
            frame[place] = Slot(make(frame))
        return statements(frame)

    def run_with_undo(frame: Frame) -> Any:
        try:
            return run(frame)
        except (CycleLeft, LongJump):
            context.task.undo(lambda: undo[0](frame))
            raise

    def run_as_recovery_point(frame: Frame) -> Any:
        points = context.task.recovery_points
        points.append(lambda number: any(listed(frame) == number for listed in routine.listed))
        try:
            return inside(frame)
        finally:
            points.pop()

    inside = run_with_undo if undo else run
    routine.body = run_as_recovery_point if routine.listed else inside


def _local(context: CompileContext, node: Node) -> tuple[int, Run]:
    storage, called, line = name(node, 1), name(node, 3), line_of(node)
    if storage == "pers":
        raise context.wrong(line, f"PERS {called} in a routine: a PERS belongs to a module")
    kind, initial = _type_and_initial(context, node)
    place = context.local(called, kind, storage, line).place
    if initial is None:
        return place, lambda frame: kind.initial()
    return place, lambda frame: kind.copy(initial(frame))


SYSTEM = "system.rapid"


def _bare(scope: Scope) -> CompileContext:
    return CompileContext(None, SYSTEM, scope, ErrorNumbers({}, Slot(0.0)), call)


def parameters_of(context: CompileContext, node: Node | None) -> tuple[Parameter, ...]:
    """Parameters of a header, in order; alternatives share a number above 0."""
    found: list[Parameter] = []
    for number, child in enumerate([] if node is None else parts(node), 1):
        if child.data == "parameter":
            found.append(_parameter(context, child))
            continue
        alternatives = parts(child)
        shared = number if len(alternatives) > 1 else 0
        found += [_parameter(context, each, True, shared) for each in alternatives]
    return tuple(found)


def _parameter(context: CompileContext, node: Node, optional: bool = False, alternative: int = 0) -> Parameter:
    mode = "in" if node.children[0] is None else name(node, 0)
    kind: Type = context.require_type(name(node, 1), line_of(node))
    for _ in [star for star in node.children[3:] if star is not None]:
        kind = Array(kind, OPEN)
    return Parameter(name(node, 2), kind, mode, optional, alternative)


def declare_types(modules: Sequence[tuple[CompileContext, Node]], everywhere: Scope) -> None:
    """Declare the records and aliases of modules `everywhere`, LOCAL ones in the module's scope, in any order."""
    waiting = [
        (context, node) for context, module in modules for node in parts(module) if node.data in ("record", "alias")
    ]
    while waiting:
        left, first = [], None
        for context, node in waiting:
            try:
                local = node.children[0] is not None and name(node, 0) == "local"
                types = (context.scope if local else everywhere).types
                if node.data == "record":
                    components = tuple((name(c, 1), context.require_type(name(c, 0), line_of(c))) for c in parts(node))
                    types[name(node, 1)] = Record(name(node, 1), components)
                else:
                    types[name(node, 2)] = context.require_type(name(node, 1), line_of(node))
            except RapidProgramError as error:
                first = first or error
                left.append((context, node))
        if first is not None and len(left) == len(waiting):
            raise first
        waiting = left


@cache
def system_types() -> Mapping[str, Type]:
    """Types a controller provides."""
    scope = Scope(types={atom.name: atom for atom in (*ATOMS, *DEVICES)})
    declare_types([(_bare(scope), parse_system())], scope)
    return scope.types


@cache
def builtins() -> tuple[Builtin, ...]:
    """Every instruction and function of system.rapid with its implementation."""
    context = _bare(Scope(types=dict(system_types())))
    found = []
    for node in parts(parse_system()):
        if node.data not in ("proc_header", "func_header"):
            continue
        function = node.data == "func_header"
        called = name(node, int(function))
        if called not in DOES:
            raise RapidProgramError(SYSTEM, line_of(node), f"{called} has no implementation")
        parameters = parameters_of(context, part(node, -1) if parts(node) else None)
        result = context.require_type(name(node, 0), line_of(node)) if function else None
        kind, left_out = "func" if function else "proc", LEFT_OUT.get(called, frozenset())
        found.append(Builtin(called, kind, parameters, result, DOES[called], left_out))
    return tuple(found)
