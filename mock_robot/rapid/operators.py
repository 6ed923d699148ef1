"""Operator tables: for two operand types, the result type and the closure that combines two closures."""

import math
import operator as op
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.types import BOOL, DNUM, NUM, STRING, Record, Type
from mock_robot.rapid.values import MAX_INTEGER, integer, short, single

Evaluate = Callable[[Any], Any]
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
