"""Binary layouts of the CB link's messages: one table, with encoding and decoding.

Little-endian; every real number is a float32 on the wire.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from protocols.cb.codes import Capability, Command, Flag, FrameSelector, MoveKind, Output, Status
from protocols.cb.errors import FieldOutOfRange, PayloadRefused
from protocols.cb.messages import (
    Answer,
    ArmingDone,
    Bye,
    ErrorText,
    Farewell,
    GetError,
    GetJoints,
    GetPose,
    GetSetup,
    GetStatus,
    Hello,
    JointMoveAccepted,
    Joints,
    Move,
    MoveAccepted,
    MoveJoints,
    OutputDone,
    Ping,
    Pong,
    Pose,
    Report,
    Request,
    SetArmed,
    SetOutput,
    Setup,
    Stop,
    Stopped,
    Welcome,
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


_POSE = (
    _Field("position_mm", "3f"),
    _Field("quaternion_wxyz", "4f"),
    _Field("configuration", "4h"),
    _Field("external_axes", "6f"),
)

_FIELDS: dict[type[Any], tuple[_Field, ...]] = {
    Ping: (),
    Hello: (_Field("version_min", "H"), _Field("version_max", "H"), _Field("client_id", "H"), _Field("flags", "H")),
    GetPose: (_Field("frame", "H", FrameSelector),),
    Move: (*_POSE, _Field("speed_mm_s", "f"), _Field("kind", "Hxx", MoveKind)),
    Stop: (),
    GetStatus: (),
    SetArmed: (_Field("session", "H"), _Field("armed", "H", _boolean)),
    GetJoints: (),
    Bye: (),
    Pong: (),
    Welcome: (
        _Field("version", "H"),
        _Field("capabilities", "H", Capability),
        _Field("session", "H"),
        _Field("build", "H"),
        _Field("rawbytes_max", "H"),
        _Field("robot_axes", "H"),
    ),
    Pose: (*_POSE, _Field("t_ms", "I"), _Field("flags", "Hxx", Flag)),
    MoveAccepted: (),
    Stopped: (),
    Report: (
        _Field("flags", "H", Flag),
        _Field("finished_seq", "H"),
        _Field("finished_status", "H"),
        _Field("progress_per_mille", "H"),
        _Field("t_ms", "I"),
    ),
    ArmingDone: (),
    Joints: (_Field("axes_deg", "6f"), _Field("external_axes", "6f")),
    Farewell: (),
    MoveJoints: (_Field("axes_deg", "6f"), _Field("external_axes", "6f"), _Field("speed_mm_s", "f")),
    GetError: (),
    SetOutput: (_Field("output", "H", Output), _Field("on", "H", _boolean)),
    GetSetup: (),
    JointMoveAccepted: (),
    ErrorText: (_Field("number", "I"), _Field("title", "80s", _text), _Field("cause", "80s", _text)),
    OutputDone: (),
    Setup: (
        _Field("load_kg", "f"),
        _Field("load_centre_mm", "3f"),
        _Field("reach_mm", "f"),
        _Field("speed_max_mm_s", "f"),
        _Field("joint_travel_deg", "f"),
        _Field("box_low_mm", "3f"),
        _Field("box_high_mm", "3f"),
    ),
}

STRUCTS = {kind: struct.Struct("<" + "".join(f.layout for f in fields)) for kind, fields in _FIELDS.items()}

REQUESTS: dict[Command, type[Request]] = {
    Command.PING: Ping,
    Command.HELLO: Hello,
    Command.GET_POSE: GetPose,
    Command.MOVE: Move,
    Command.STOP: Stop,
    Command.STATUS: GetStatus,
    Command.ARM: SetArmed,
    Command.GET_JOINTS: GetJoints,
    Command.BYE: Bye,
    Command.MOVE_JOINTS: MoveJoints,
    Command.GET_ERROR: GetError,
    Command.SET_OUTPUT: SetOutput,
    Command.GET_SETUP: GetSetup,
}
"""Request type of each command."""

ANSWERS: dict[Command, type[Answer]] = {
    Command.PING: Pong,
    Command.HELLO: Welcome,
    Command.GET_POSE: Pose,
    Command.MOVE: MoveAccepted,
    Command.STOP: Stopped,
    Command.STATUS: Report,
    Command.ARM: ArmingDone,
    Command.GET_JOINTS: Joints,
    Command.BYE: Farewell,
    Command.MOVE_JOINTS: JointMoveAccepted,
    Command.GET_ERROR: ErrorText,
    Command.SET_OUTPUT: OutputDone,
    Command.GET_SETUP: Setup,
}
"""Reply type of each command that succeeded."""

COMMAND_OF: dict[type[Any], Command] = {
    kind: command for table in (REQUESTS, ANSWERS) for command, kind in table.items()
}
"""Command of each message type, requests and replies alike."""


def good_status(answer: Answer) -> Status:
    """Status sent with a reply: ACCEPTED for a move, otherwise OK."""
    return Status.ACCEPTED if isinstance(answer, MoveAccepted | JointMoveAccepted) else Status.OK


def pack(message: Request | Answer) -> bytes:
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
