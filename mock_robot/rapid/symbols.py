"""PERS of a running program as text in RAPID's spelling, as Robot Web Services read and write them."""

import re
from dataclasses import dataclass
from typing import Any

from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.scope import Persistent
from mock_robot.rapid.types import Array, Atom, Record, Type
from mock_robot.rapid.values import number_text, short, single

_TOKEN = re.compile(r'\s*("(?:[^"]|"")*"|[\[\],]|[-+]?[\d.]+(?:[eE][-+]?\d+)?|TRUE|FALSE)\s*', re.IGNORECASE)


@dataclass(eq=False)
class LiveSymbol:
    """A PERS of the program in memory."""

    kind: Type
    slot: Persistent

    @property
    def type(self) -> str:
        return self.kind.name

    @property
    def value(self) -> str:
        """Its value as text. Setting raises ValueError for text that is no value of the type."""
        return text_of(self.kind, self.slot.value)

    @value.setter
    def value(self, text: str) -> None:
        self.slot.value = value_of(self.kind, text)


def text_of(kind: Type, value: Any) -> str:
    """A value in RAPID's spelling."""
    if not isinstance(kind, Atom):
        return "[" + ",".join(text_of(part, each) for part, each in zip(kind.parts, value, strict=True)) + "]"
    if kind.name == "bool":
        return "TRUE" if value else "FALSE"
    if kind.name == "string":
        return '"' + str(value).replace('"', '""') + '"'
    return number_text(float(value))


def value_of(kind: Type, text: str) -> Any:
    """The value that a text spells. Raises ValueError."""
    tokens, at = [], 0
    while at < len(text):
        found = _TOKEN.match(text, at)
        if found is None:
            raise ValueError(f"{text!r} is no RAPID value")
        tokens.append(found.group(1))
        at = found.end()
    try:
        value = _take(kind, tokens)
    except RapidError as error:
        raise ValueError(str(error)) from error
    if tokens:
        raise ValueError(f"{text!r} has more than a {kind.name}")
    return value


def _take(kind: Type, tokens: list[str]) -> Any:
    if isinstance(kind, Atom):
        return _atom(kind, tokens.pop(0) if tokens else "")
    values = []
    for at, part in enumerate(kind.parts):
        _expect("," if at else "[", tokens, kind)
        values.append(_take(part, tokens))
    _expect("]", tokens, kind)
    return values


def _expect(token: str, tokens: list[str], kind: Record | Array) -> None:
    if not tokens or tokens.pop(0) != token:
        raise ValueError(f"a {kind.name} has {len(kind.parts)} parts in brackets")


def _atom(kind: Atom, token: str) -> Any:
    if kind.name == "bool" and token.upper() in ("TRUE", "FALSE"):
        return token.upper() == "TRUE"
    if kind.name == "string" and token.startswith('"'):
        return short(token[1:-1].replace('""', '"'))
    if kind.name in ("num", "dnum"):
        return single(float(token)) if kind.name == "num" else float(token)
    raise ValueError(f"{token!r} is no {kind.name}")
