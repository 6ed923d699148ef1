"""Expressions to closures: checked for their types once, then evaluated without looking back."""

import math
import operator as op
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import reduce
from types import MappingProxyType
from typing import Any

from lark import Token, Tree

from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.scope import Builtin, CompileContext, Data, Frame, Part, Routine, Slot
from mock_robot.rapid.signals import number_of
from mock_robot.rapid.syntax import Node, line_of, name, part, parts, word
from mock_robot.rapid.types import BOOL, BYTE, DNUM, NUM, OPEN, SIGNAL_TYPES, STRING, Array, Record, Type
from mock_robot.rapid.values import MAX_INTEGER, integer, short, single

Evaluate = Callable[[Frame], Any]


# For two operand types, the result type and the closure that combines two closures.

Combine = Callable[[Evaluate, Evaluate], Evaluate]


def _plain(function: Callable[[Any, Any], Any]) -> Combine:
    return lambda first, second: lambda frame: function(first(frame), second(frame))


def _divide(a: float, b: float) -> float:
    if b == 0:
        raise RapidError("ERR_DIVZERO", f"{a:g} / 0")
    return single(a / b)


def _quotient(a: float, b: float) -> float:
    """DIV truncates towards zero."""
    if integer(b) == 0:
        raise RapidError("ERR_DIVZERO", f"{a:g} DIV 0")
    return float(math.trunc(integer(a) / integer(b)))


def _remainder(a: float, b: float) -> float:
    """MOD has the sign of the dividend."""
    if not (a.is_integer() and b.is_integer() and abs(a) <= MAX_INTEGER >= abs(b) > 0):
        integer(a)
        if integer(b) == 0:
            raise RapidError("ERR_DIVZERO", f"{a:g} MOD 0")
    return math.fmod(a, b) + 0.0


def _vector(function: Callable[[float, float], float]) -> Combine:
    return _plain(lambda a, b: [single(function(x, y)) for x, y in zip(a, b, strict=True)])


def _multiply_rotations(a: list[float], b: list[float]) -> list[float]:
    """Product of two rotations (q1, q2, q3, q4), q1 the scalar."""
    (aw, ax, ay, az), (bw, bx, by, bz) = a, b
    product = (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )
    return [single(value) for value in product]


def _cross_product(a: list[float], b: list[float]) -> list[float]:
    (ax, ay, az), (bx, by, bz) = a, b
    return [single(v) for v in (ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)]


POS = Record("pos", (("x", NUM), ("y", NUM), ("z", NUM)))
ORIENT = Record("orient", (("q1", NUM), ("q2", NUM), ("q3", NUM), ("q4", NUM)))

COMPARISONS: Mapping[str, Combine] = MappingProxyType(
    {
        "=": lambda first, second: lambda frame: first(frame) == second(frame),
        "<>": lambda first, second: lambda frame: first(frame) != second(frame),
        "<": lambda first, second: lambda frame: first(frame) < second(frame),
        "<=": lambda first, second: lambda frame: first(frame) <= second(frame),
        ">": lambda first, second: lambda frame: first(frame) > second(frame),
        ">=": lambda first, second: lambda frame: first(frame) >= second(frame),
    }
)

_ARITHMETIC: dict[tuple[str, str, str], tuple[Type, Combine]] = {
    ("+", "num", "num"): (NUM, lambda first, second: lambda frame: single(first(frame) + second(frame))),
    ("-", "num", "num"): (NUM, lambda first, second: lambda frame: single(first(frame) - second(frame))),
    ("*", "num", "num"): (NUM, lambda first, second: lambda frame: single(first(frame) * second(frame))),
    ("/", "num", "num"): (NUM, _plain(_divide)),
    ("DIV", "num", "num"): (NUM, _plain(_quotient)),
    ("MOD", "num", "num"): (NUM, _plain(_remainder)),
    ("+", "dnum", "dnum"): (DNUM, _plain(op.add)),
    ("-", "dnum", "dnum"): (DNUM, _plain(op.sub)),
    ("*", "dnum", "dnum"): (DNUM, _plain(op.mul)),
    ("+", "string", "string"): (STRING, _plain(lambda a, b: short(a + b))),
    ("+", "pos", "pos"): (POS, _vector(op.add)),
    ("-", "pos", "pos"): (POS, _vector(op.sub)),
    ("*", "pos", "num"): (POS, _plain(lambda a, b: [single(x * b) for x in a])),
    ("*", "num", "pos"): (POS, _plain(lambda a, b: [single(a * x) for x in b])),
    ("/", "pos", "num"): (POS, _plain(lambda a, b: [_divide(x, b) for x in a])),
    ("*", "pos", "pos"): (POS, _plain(_cross_product)),
    ("*", "orient", "orient"): (ORIENT, _plain(_multiply_rotations)),
    ("AND", "bool", "bool"): (BOOL, lambda first, second: lambda frame: first(frame) and second(frame)),
    ("OR", "bool", "bool"): (BOOL, lambda first, second: lambda frame: first(frame) or second(frame)),
    ("XOR", "bool", "bool"): (BOOL, _plain(op.ne)),
}
_ORDERED = {(sign, kind, kind): (BOOL, COMPARISONS[sign]) for sign in COMPARISONS for kind in ("num", "dnum")}

BINARY: Mapping[tuple[str, str, str], tuple[Type, Combine]] = MappingProxyType({**_ARITHMETIC, **_ORDERED})
"""Result type and combination by operator and operand types."""

MINUS: Mapping[str, Callable[[Any], Any]] = MappingProxyType(
    {"num": op.neg, "dnum": op.neg, "pos": lambda value: [-item for item in value]}
)
"""Unary minus by type."""


@dataclass(frozen=True)
class Expression:
    """A type, and what gives the value in a frame."""

    type: Type
    evaluate: Evaluate


def expression(context: CompileContext, node: Node, wanted: Type | None = None) -> Expression:
    """Compile an expression; `wanted` decides what a number or an aggregate is. Raises RapidProgramError."""
    found = _KINDS[node.data](context, node, wanted)
    if wanted is NUM:
        found = as_value(context, found)
    if wanted is not None and found.type != wanted and not fits(wanted, found.type):
        raise context.wrong(line_of(node), f"{wanted.name} is wanted here, this is {found.type.name}")
    return found


def fits(wanted: Type, given: Type) -> bool:
    """Whether the types are the same; an array of any length fits {*}."""
    while isinstance(wanted, Array) and wanted.length == OPEN and isinstance(given, Array):
        wanted, given = wanted.element, given.element
    return wanted == given


def as_value(context: CompileContext, found: Expression) -> Expression:
    """A signal in an expression stands for its number; anything else for itself."""
    if found.type not in SIGNAL_TYPES.values():
        return found
    evaluate = found.evaluate
    return Expression(NUM, lambda frame: number_of(evaluate(frame)))


def _number(context: CompileContext, node: Node, wanted: Type | None) -> Expression:
    value = float(word(node, 0))
    if wanted is DNUM:
        return Expression(DNUM, lambda frame: value)
    if wanted is BYTE and value.is_integer() and 0 <= value <= 255:
        return Expression(BYTE, lambda frame: int(value))
    value = single(value)
    return Expression(NUM, lambda frame: value)


def _string(context: CompileContext, node: Node, wanted: Type | None) -> Expression:
    text = unquote(word(node, 0))
    try:
        short(text)
    except RapidError as error:
        raise context.wrong(line_of(node), error.detail) from None
    return Expression(STRING, lambda frame: text)


def unquote(literal: str) -> str:
    """The text of a string literal: doubled quotes and backslashes are one, backslash and two hex digits a byte."""
    text, at = "", 1
    while at < len(literal) - 1:
        if literal[at] == "\\" and literal[at + 1] != "\\":
            text, at = text + chr(int(literal[at + 1 : at + 3], 16)), at + 3
        elif literal[at] in '\\"':
            text, at = text + literal[at], at + 2
        else:
            text, at = text + literal[at], at + 1
    return text


def aggregate(context: CompileContext, node: Node, wanted: Type | None) -> Expression:
    """Compile [...] as a record or an array; one of {*} takes the lengths that are given."""
    if not isinstance(wanted, Record | Array):
        raise context.wrong(
            line_of(node), f"an aggregate cannot be {'without a type' if wanted is None else 'a value'}"
        )
    items = parts(node)
    if isinstance(wanted, Array) and wanted.length == OPEN:
        wanted = _with_lengths(wanted, node)
    if len(items) != len(wanted.parts):
        raise context.wrong(line_of(node), f"{wanted.name} has {len(wanted.parts)} parts, here are {len(items)}")
    evaluates = [expression(context, item, kind).evaluate for item, kind in zip(items, wanted.parts, strict=True)]
    copies = [kind.copy for kind in wanted.parts]
    pairs = list(zip(copies, evaluates, strict=True))
    return Expression(wanted, lambda frame: [copy(evaluate(frame)) for copy, evaluate in pairs])


def _with_lengths(wanted: Array, node: Node) -> Array:
    """An array {*} with the lengths that the aggregate has."""
    items = parts(node)
    element = wanted.element
    if isinstance(element, Array) and element.length == OPEN and items:
        element = _with_lengths(element, items[0])
    return Array(element, len(items))


def _binary(context: CompileContext, node: Node, wanted: Type | None) -> Expression:
    """Operands and operators in turn, from left to right."""
    children = node.children
    wish = DNUM if wanted is DNUM else None
    first = part(node, 0)
    if first.data == "aggregate":  # [10, 0, 0] + point.trans
        left = expression(context, first, expression(context, part(node, 2)).type)
    else:
        left = expression(context, first, None if wish is None else _wish(context, first, wish))
    for operator, operand in zip(children[1::2], children[2::2], strict=True):
        assert isinstance(operand, Tree)
        right = expression(context, operand, _wish(context, operand, left.type if left.type is DNUM else None))
        left = _combine(context, str(operator).upper(), left, right, line_of(node))
    return left


def _wish(context: CompileContext, node: Node, wanted: Type | None) -> Type | None:
    """A literal number may become a dnum; nothing else may."""
    return wanted if wanted is DNUM and node.data == "number" else None


def _combine(context: CompileContext, operator: str, left: Expression, right: Expression, line: int) -> Expression:
    left, right = as_value(context, left), as_value(context, right)
    entry = BINARY.get((operator, left.type.name, right.type.name))
    if entry is None and operator in ("=", "<>") and left.type == right.type and not getattr(left.type, "device", 0):
        entry = (BOOL, COMPARISONS[operator])
    if entry is None:
        raise context.wrong(line, f"{left.type.name} {operator} {right.type.name} is nothing")
    result, combine = entry
    first, second = left.evaluate, right.evaluate
    return Expression(result, combine(first, second))


def _conjunction(context: CompileContext, node: Node, wanted: Type | None) -> Expression:
    terms = [expression(context, item, BOOL).evaluate for item in parts(node)]
    return Expression(BOOL, reduce(BINARY["AND", "bool", "bool"][1], terms))


def _not(context: CompileContext, node: Node, wanted: Type | None) -> Expression:
    inner = expression(context, part(node, 0), BOOL).evaluate
    return Expression(BOOL, lambda frame: not inner(frame))


def _minus(context: CompileContext, node: Node, wanted: Type | None) -> Expression:
    inner = expression(context, part(node, 0), _wish(context, part(node, 0), wanted))
    if inner.type.name not in MINUS:
        raise context.wrong(line_of(node), f"- {inner.type.name} is nothing")
    negate, evaluate = MINUS[inner.type.name], inner.evaluate
    return Expression(inner.type, lambda frame: negate(evaluate(frame)))


def _function(context: CompileContext, node: Node, wanted: Type | None) -> Expression:
    called = name(node, 0)
    if called == "present":
        return _present(context, node)
    symbol = context.scope.find(called)
    if not isinstance(symbol, Routine | Builtin) or symbol.kind != "func":
        raise context.wrong(line_of(node), f"no function is named {word(node, 0)}")
    assert symbol.result is not None
    return Expression(symbol.result, context.call(context, symbol, node))


def _present(context: CompileContext, node: Node) -> Expression:
    """A parameter that is not optional is present: modules in backups of real controllers ask for one."""
    arguments = parts(node)
    target = parts(arguments[0])[0] if arguments else None
    symbol = None if target is None or target.data != "target" else context.scope.find(name(target, 0))
    own = () if context.routine is None else context.routine.parameters
    if not isinstance(symbol, Data) or symbol.slot is not None or all(symbol.name != each.name for each in own):
        raise context.wrong(line_of(node), "Present asks for a parameter of its routine")
    place = symbol.place
    return Expression(BOOL, lambda frame: frame[place] is not None)


def _target(context: CompileContext, node: Node, wanted: Type | None) -> Expression:
    symbol, indices, steps, kind = resolve(context, node)
    evaluate = _reader(symbol)
    for index in indices:
        evaluate = _element(evaluate, index)
    for step in steps:
        evaluate = _component(evaluate, step)
    return Expression(kind, evaluate)


def _element(whole: Evaluate, index: Evaluate) -> Evaluate:
    return lambda frame: (value := whole(frame))[place_of(index(frame), len(value))]


def _component(whole: Evaluate, place: int) -> Evaluate:
    return lambda frame: whole(frame)[place]


def _reader(symbol: Data) -> Evaluate:
    slot, place = symbol.slot, symbol.place
    if slot is None:
        return lambda frame: frame[place].value
    if symbol.storage == "const":
        constant = slot.value
        return lambda frame: constant
    return lambda frame: slot.value


def resolve(context: CompileContext, node: Node) -> tuple[Data, list[Evaluate], list[int], Type]:
    """What a target names: the data, the indices into it, the components within, and the type in the end."""
    symbol = context.scope.find(name(node, 0))
    if not isinstance(symbol, Data):
        raise context.wrong(line_of(node), f"no data is named {word(node, 0)}")
    kind, indices, steps = symbol.type, [], []
    for child in parts(node):
        if child.data == "component_of":
            place = kind.place(name(child, 0)) if isinstance(kind, Record) else None
            if place is None:
                raise context.wrong(line_of(node), f"{kind.name} has no component {word(child, 0)}")
            steps.append(place)
            kind = kind.parts[place]  # type: ignore[union-attr]
        else:
            if not isinstance(kind, Array):
                raise context.wrong(line_of(node), f"{word(node, 0)} has no such dimension")
            indices.append(expression(context, child, NUM).evaluate)
            kind = kind.element
    return symbol, indices, steps, kind


def place_of(index: float, length: int) -> int:
    """Where element `index` (counted from 1) lies. Raises ERR_OUTOFBND."""
    if not 1 <= index <= length or index != math.floor(index):
        raise RapidError("ERR_OUTOFBND", f"element {index:g} of {length}")
    return int(index) - 1


def reference(context: CompileContext, node: Node) -> tuple[Data, Type, Evaluate]:
    """A target as something that can be written to: its data, its type, and what gives the slot in a frame."""
    if node.data != "target":
        raise context.wrong(line_of(node), "a data object is wanted here, not an expression")
    symbol, indices, steps, kind = resolve(context, node)
    slot, place = symbol.slot, symbol.place
    root: Evaluate = (lambda frame: frame[place]) if slot is None else (lambda frame: slot)
    if not indices and not steps:
        return symbol, kind, root

    def part_of(frame: Frame) -> Part:
        holder: Slot = root(frame)
        value = holder.value
        places = [place_of(index(frame), len(value)) for index in indices] + steps
        for step in places[:-1]:
            value = value[step]
        return Part(value, places[-1], holder)

    return symbol, kind, part_of


def _literal(value: bool) -> Callable[[CompileContext, Node, Type | None], Expression]:
    return lambda context, node, wanted: Expression(BOOL, lambda frame: value)


_KINDS: dict[str | Token, Callable[[CompileContext, Node, Type | None], Expression]] = {
    "number": _number,
    "string": _string,
    "true": _literal(True),
    "false": _literal(False),
    "aggregate": aggregate,
    "expr": _binary,
    "comparison": _binary,
    "sum": _binary,
    "product": _binary,
    "conjunction": _conjunction,
    "not_": _not,
    "minus": _minus,
    "function": _function,
    "target": _target,
}
