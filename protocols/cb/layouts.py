"""Binary layouts of the CB link's messages, read off the types of their fields, with encoding and decoding.

Little-endian; every real number is a float32 on the wire.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass
from enum import EnumType
from typing import Annotated, Any, get_args, get_origin, get_type_hints

from protocols.cb.codes import Command, Status
from protocols.cb.errors import FieldOutOfRange, PayloadRefused
from protocols.cb.messages import (
    MESSAGES,
    ConfData,
    Four,
    JointMoveAccepted,
    MoveAccepted,
    Request,
    Six,
    Success,
    Three,
)


@dataclass(frozen=True)
class _Field:
    name: str
    layout: str
    convert: Callable[[Any], Any] | None = None


def _boolean(number: int) -> bool:
    if number not in (0, 1):
        raise ValueError(f"{number} is neither 0 nor 1")
    return bool(number)


def _text(padded: bytes) -> str:
    """A RAPID string of at most 80 bytes, padded with zeros."""
    return padded.rstrip(b"\0").decode("latin-1")


_LAYOUTS: dict[Any, str] = {float: "f", str: "80s", Three: "3f", Four: "4f", Six: "6f", ConfData: "4h"}
"""Of each type but whole numbers, truths and codes, in the format of `struct`."""

_CONVERTED: dict[Any, Callable[[Any], Any]] = {bool: _boolean, str: _text}


def _field(name: str, hint: Any) -> _Field:
    kind, *stated = get_args(hint) if get_origin(hint) is Annotated else (hint,)
    convert = kind if isinstance(kind, EnumType) else _CONVERTED.get(kind)
    return _Field(name, stated[0] if stated else _LAYOUTS.get(kind, "H"), convert)


_FIELDS: dict[type[Any], tuple[_Field, ...]] = {
    kind: tuple(_field(*each) for each in get_type_hints(kind, include_extras=True).items())
    for pair in MESSAGES.values()
    for kind in pair
}

STRUCTS = {kind: struct.Struct("<" + "".join(f.layout for f in fields)) for kind, fields in _FIELDS.items()}

REQUESTS = {command: request for command, (request, _) in MESSAGES.items()}
ANSWERS = {command: answer for command, (_, answer) in MESSAGES.items()}

COMMAND_OF: dict[type[Any], Command] = {
    kind: command for table in (REQUESTS, ANSWERS) for command, kind in table.items()
}
"""Command of each message type, requests and replies alike."""


def good_status(answer: Success) -> Status:
    """Status sent with a reply: ACCEPTED for a move, otherwise OK."""
    return Status.ACCEPTED if isinstance(answer, MoveAccepted | JointMoveAccepted) else Status.OK


def pack(message: Request | Success) -> bytes:
    """Encode a message's payload; raises FieldOutOfRange."""
    kind = type(message)
    values: list[Any] = []
    for field in _FIELDS[kind]:
        value = getattr(message, field.name)
        if isinstance(value, str):
            value = value.encode("latin-1", "replace")
        values += value if isinstance(value, tuple) else (value,)
    try:
        return STRUCTS[kind].pack(*values)
    except (struct.error, OverflowError) as error:
        raise FieldOutOfRange(kind.__name__, str(error)) from error


def unpack(kind: type[Any], payload: bytes) -> Any:
    """Decode a payload as a message of type `kind`; raises PayloadRefused."""
    layout = STRUCTS[kind]
    if len(payload) != layout.size:
        raise PayloadRefused(kind.__name__, f"{len(payload)} bytes instead of {layout.size}", Status.BAD_LEN)
    values = iter(layout.unpack(payload))
    fields: dict[str, Any] = {}
    for field in _FIELDS[kind]:
        count = int(field.layout[:-1]) if field.layout[0].isdigit() and field.layout[-1] != "s" else 1
        value = tuple(next(values) for _ in range(count)) if count > 1 else next(values)
        try:
            fields[field.name] = field.convert(value) if field.convert else value
        except ValueError as error:
            raise PayloadRefused(kind.__name__, f"{field.name}: {error}", Status.BAD_FIELD) from error
    return kind(**fields)
