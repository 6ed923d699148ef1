"""Calls: arguments bound to parameters, checked against the header; then a closure that calls."""

from typing import Any

from lark import Token, Tree

from mock_robot.rapid.errors import ProgramStopped, RaisedFurther
from mock_robot.rapid.expressions import Evaluate, Expression, aggregate, expression, fits, reference
from mock_robot.rapid.scope import Builtin, CompileContext, Frame, Parameter, Routine, Slot
from mock_robot.rapid.syntax import Node, line_of, name, parts, word
from mock_robot.rapid.tasks import EXECUTION_ERROR
from mock_robot.rapid.types import ANYTYPE, BOOL, CONDITION, SWITCH, Array, Atom

WRITABLE = {"var": ("var",), "pers": ("pers",), "inout": ("var", "pers")}
"""Which data may be passed to a parameter of that mode."""


def call(context: CompileContext, symbol: Routine | Builtin, node: Node) -> Evaluate:
    """What calls the routine or instruction of this node. Raises RapidProgramError."""
    given = _match_arguments(context, symbol, node)
    if isinstance(symbol, Builtin):
        for parameter, argument in zip(symbol.parameters, given, strict=True):
            if argument is not None and parameter.name in symbol.left_out:
                raise context.wrong(line_of(node), f"the mock does not do {symbol.name} \\{parameter.name}")
    makers = [
        _absent if argument is None else _maker(context, parameter, argument, node, isinstance(symbol, Routine))
        for parameter, argument in zip(symbol.parameters, given, strict=True)
    ]
    if isinstance(symbol, Builtin):
        return _builtin_call(symbol, makers, context.task)
    return _routine_call(symbol, makers)


def _builtin_call(symbol: Builtin, makers: list[Evaluate], task: Any) -> Evaluate:
    """Most arguments of most instructions are left out: only the others are made for each call."""
    does = symbol.does
    makers = [make for p, make in zip(symbol.parameters, makers, strict=True) if p.name not in symbol.left_out]
    none: list[Any] = [None] * len(makers)
    given = [(place, make) for place, make in enumerate(makers) if make is not _absent]

    def run(frame: Frame) -> Any:
        arguments: list[Any] = none[:]
        for place, make in given:
            arguments[place] = make(frame)
        return does(task, *arguments)

    return run


def _routine_call(routine: Routine, makers: list[Evaluate]) -> Evaluate:
    function = routine.result is not None

    def run(frame: Frame) -> Any:
        inner: Frame = [None, *[make(frame) for make in makers]]
        inner += [None] * (routine.places + 1 - len(inner))
        assert routine.body is not None
        try:
            if not routine.body(inner) and function:
                raise ProgramStopped(EXECUTION_ERROR, routine.where, f"{routine.name} ended without RETURN")
        except RaisedFurther as raised:
            raise raised.error from None
        return inner[0]

    return run


def _absent(frame: Frame) -> None:
    """The value of an optional argument that was not given."""


Argument = Node | bool


def _match_arguments(context: CompileContext, symbol: Routine | Builtin, node: Node) -> list[Argument | None]:
    """For each parameter its argument: an expression, True for a switch, None when it is left out."""
    arguments = parts(node, "arguments")
    required, options = [], {}
    for child in parts(arguments[0]) if arguments else []:
        if child.data == "option":
            if name(child, 0) in options:
                raise context.wrong(line_of(child), f"\\{word(child, 0)} is given twice")
            options[name(child, 0)] = child
        else:
            required.append(child)
    wanted = [parameter for parameter in symbol.parameters if not parameter.optional]
    if len(required) != len(wanted):
        takes = ", ".join(parameter.name for parameter in wanted) or "none"
        raise context.wrong(
            line_of(node), f"{symbol.name} takes {len(wanted)} arguments ({takes}), not {len(required)}"
        )
    for unknown in options.keys() - {p.name for p in symbol.parameters if p.optional}:
        raise context.wrong(line_of(options[unknown]), f"{symbol.name} has no argument \\{unknown}")
    _require_one_alternative(context, symbol, options, node)
    _require_order(context, symbol, node)
    queue = iter(required)
    return [_option(context, p, options.get(p.name)) if p.optional else next(queue) for p in symbol.parameters]


def _require_one_alternative(
    context: CompileContext, symbol: Routine | Builtin, options: dict[str, Node], node: Node
) -> None:
    seen: dict[int, str] = {}
    for parameter in symbol.parameters:
        if parameter.alternative and parameter.name in options:
            if parameter.alternative in seen:
                both = f"\\{seen[parameter.alternative]} and \\{parameter.name}"
                raise context.wrong(line_of(node), f"{symbol.name} takes one of {both}")
            seen[parameter.alternative] = parameter.name


def _require_order(context: CompileContext, symbol: Routine | Builtin, node: Node) -> None:
    """Options stand where the header has them, as a controller requires."""
    arguments = parts(node, "arguments")
    places = {parameter.name: place for place, parameter in enumerate(symbol.parameters)}
    required = iter([place for place, parameter in enumerate(symbol.parameters) if not parameter.optional])
    before = -1
    for child in parts(arguments[0]) if arguments else []:
        place = places[name(child, 0)] if child.data == "option" else next(required)
        if place < before:
            what = f"\\{word(child, 0)}" if child.data == "option" else symbol.parameters[place].name
            raise context.wrong(
                line_of(child), f"{symbol.name}: {what} comes before \\{symbol.parameters[before].name}"
            )
        before = place


def _option(context: CompileContext, parameter: Parameter, node: Node | None) -> Argument | None:
    if node is None:
        return None
    value = node.children[1]
    if (parameter.type == SWITCH) is not (value is None):
        raise context.wrong(line_of(node), f"\\{parameter.name} {'takes no' if value is not None else 'wants a'} value")
    assert not isinstance(value, Token)
    return True if value is None else value


def _maker(context: CompileContext, parameter: Parameter, argument: Argument, node: Node, own: bool) -> Evaluate:
    """What makes the argument in the caller's frame: a slot for a routine (`own`), the plain value for a builtin."""
    if not isinstance(argument, Tree):
        return (lambda frame: Slot(True)) if own else (lambda frame: True)
    if parameter.mode != "in":
        return _by_reference(context, parameter, argument, own)
    if parameter.type == CONDITION:
        condition = expression(context, argument, BOOL).evaluate
        return lambda frame: lambda: condition(frame)
    if parameter.type == ANYTYPE:
        found = expression(context, argument)
        kind, evaluate = found.type, found.evaluate
        return lambda frame: (kind, evaluate(frame))
    if isinstance(parameter.type, Atom) and parameter.type.device and own:
        raise context.wrong(line_of(argument), f"{parameter.type.name} can only be passed by reference")
    if isinstance(parameter.type, Array):
        found = _array(context, argument, parameter.type)
        if not fits(parameter.type, found.type):
            raise context.wrong(line_of(argument), f"{parameter.name} wants an array, this is {found.type.name}")
        evaluate = found.evaluate
    else:
        evaluate = expression(context, argument, parameter.type).evaluate
    if not own:
        return evaluate
    copy = parameter.type.copy
    return lambda frame: Slot(copy(evaluate(frame)))


def _array(context: CompileContext, argument: Node, wanted: Array) -> Expression:
    if argument.data == "aggregate":
        return aggregate(context, argument, wanted)
    return expression(context, argument)


def _by_reference(context: CompileContext, parameter: Parameter, argument: Node, own: bool) -> Evaluate:
    symbol, kind, slot_in = reference(context, argument)
    if symbol.storage not in WRITABLE[parameter.mode]:
        wanted = " or ".join(each.upper() for each in WRITABLE[parameter.mode])
        why = f"{parameter.name} wants {wanted}, {symbol.name} is {symbol.storage.upper()}"
        raise context.wrong(line_of(argument), why)
    if parameter.type == ANYTYPE:
        return lambda frame: (kind, slot_in(frame))
    if not fits(parameter.type, kind):
        raise context.wrong(line_of(argument), f"{parameter.name} wants {parameter.type.name}, this is {kind.name}")
    return slot_in
