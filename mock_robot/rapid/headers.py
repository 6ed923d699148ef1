"""Parses routine headers of modules and of system.rapid to parameters; the controller's own types and routines."""

from collections.abc import Mapping, Sequence
from functools import cache

from mock_robot.rapid.calls import call
from mock_robot.rapid.devices import DEVICES
from mock_robot.rapid.errors import RapidProgramError
from mock_robot.rapid.instructions.table import DOES, LEFT_OUT
from mock_robot.rapid.scope import Builtin, CompileContext, ErrorNumbers, Parameter, Scope, Slot
from mock_robot.rapid.syntax import Node, line_of, name, parse_system, part, parts
from mock_robot.rapid.types import ATOMS, OPEN, Array, Record, Type

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
