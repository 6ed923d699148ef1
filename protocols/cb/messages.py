"""Messages of the CB link as frozen dataclasses, with one table of their binary layouts.

Millimetres, degrees, quaternions (w, x, y, z); little-endian; every real number is a float32 on the wire.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from protocols.cb.codes import Capability, Command, Flag, FrameSelector, MoveKind, Output, Status
from protocols.cb.errors import FieldOutOfRange, PayloadRefused

Three = tuple[float, float, float]
Four = tuple[float, float, float, float]
Six = tuple[float, float, float, float, float, float]
ConfData = tuple[int, int, int, int]

_STATUS_NAMES = {int(status): status.name for status in Status}

T_MS_WRAP = 8_000_000
"""The controller's milliseconds since HELLO wrap here, because RAPID's num is exact only up to 2^23."""


@dataclass(frozen=True)
class Ping:
    """Connection check and heartbeat."""


@dataclass(frozen=True)
class Hello:
    """Versions and id of the client; the first request of a connection. `version_max` 0 means `version_min`."""

    version_min: int
    version_max: int
    client_id: int
    flags: int = 0

    def speaks(self, version: int) -> bool:
        """Whether the client supports `version`."""
        return self.version_min <= version <= (self.version_max or self.version_min)


@dataclass(frozen=True)
class GetPose:
    """Request the pose of the flange (or of the cell's tool)."""

    frame: FrameSelector = FrameSelector.TOOL0_WOBJ0


@dataclass(frozen=True)
class Move:
    """Move to a stop point. `configuration` is confdata, `external_axes` in degrees or mm, 9e9 where unused."""

    position_mm: Three
    quaternion_wxyz: Four
    configuration: ConfData
    external_axes: Six
    speed_mm_s: float
    kind: MoveKind


@dataclass(frozen=True)
class Stop:
    """Stop at once and drop the move."""


@dataclass(frozen=True)
class GetStatus:
    """Request the flags and the progress of the last move."""


@dataclass(frozen=True)
class SetArmed:
    """Allow or forbid motion in this session."""

    session: int
    armed: bool


@dataclass(frozen=True)
class GetJoints:
    """Request the axis angles."""


@dataclass(frozen=True)
class Bye:
    """The client disconnects; the controller disarms."""


@dataclass(frozen=True)
class MoveJoints:
    """Move all axes to these angles, to a stop point (MoveAbsJ): no posture, no singularity."""

    axes_deg: Six
    external_axes: Six
    speed_mm_s: float


@dataclass(frozen=True)
class GetError:
    """Request ABB's number and text of the error that ended the last move."""


@dataclass(frozen=True)
class SetOutput:
    """Switch an output that the controller's settings name."""

    output: Output
    on: bool


@dataclass(frozen=True)
class GetSetup:
    """Request the settings of the modules that concern motion."""


@dataclass(frozen=True)
class Pong:
    """Reply to PING."""


@dataclass(frozen=True)
class Welcome:
    """Reply to HELLO. A `session` other than the last one means that the controller restarted."""

    version: int
    capabilities: Capability
    session: int
    build: int
    rawbytes_max: int
    robot_axes: int


@dataclass(frozen=True)
class Pose:
    """Reply to GET_POSE. `t_ms` counts from HELLO and wraps at 8 000 000."""

    position_mm: Three
    quaternion_wxyz: Four
    configuration: ConfData
    external_axes: Six
    t_ms: int
    flags: Flag


@dataclass(frozen=True)
class MoveAccepted:
    """Reply to MOVE: the move begins; GET_STATUS reports its end. Its status is ACCEPTED, not OK."""


@dataclass(frozen=True)
class Stopped:
    """Reply to STOP."""


@dataclass(frozen=True)
class Report:
    """Reply to STATUS: number and result of the last finished move, progress of the current one.

    `finished_seq` is 0 when no move has ended in this session; `progress_per_mille` is 1000 when none is in progress.
    """

    flags: Flag
    finished_seq: int
    finished_status: int
    progress_per_mille: int
    t_ms: int


@dataclass(frozen=True)
class ArmingDone:
    """Reply to ARM."""


@dataclass(frozen=True)
class Joints:
    """Reply to GET_JOINTS: six arm axes in degrees, six external axes (9e9 where unused)."""

    axes_deg: Six
    external_axes: Six


@dataclass(frozen=True)
class Farewell:
    """Reply to BYE."""


@dataclass(frozen=True)
class JointMoveAccepted:
    """Reply to MOVE_JOINTS: the move begins, as after MOVE."""


@dataclass(frozen=True)
class ErrorText:
    """Reply to GET_ERROR: number as in the event log (50050: domain 5, number 50; 0: none), title and cause."""

    number: int
    title: str
    cause: str


@dataclass(frozen=True)
class OutputDone:
    """Reply to SET_OUTPUT."""


@dataclass(frozen=True)
class Setup:
    """Reply to GET_SETUP: the load on the flange (kg, mm), and the limits the modules hold moves to."""

    load_kg: float
    load_centre_mm: Three
    reach_mm: float
    speed_max_mm_s: float
    joint_travel_deg: float
    box_low_mm: Three
    box_high_mm: Three


@dataclass(frozen=True)
class Refused:
    """Reply to a request that was not executed. `status` is the raw number."""

    status: int

    @property
    def name(self) -> str:
        """Name of the status, or its number when it has none here."""
        return _STATUS_NAMES.get(self.status, str(self.status))


Request = (
    Ping
    | Hello
    | GetPose
    | Move
    | Stop
    | GetStatus
    | SetArmed
    | GetJoints
    | Bye
    | MoveJoints
    | GetError
    | SetOutput
    | GetSetup
)
Answer = (
    Pong
    | Welcome
    | Pose
    | MoveAccepted
    | Stopped
    | Report
    | ArmingDone
    | Joints
    | Farewell
    | JointMoveAccepted
    | ErrorText
    | OutputDone
    | Setup
)
Reply = Answer | Refused


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

_STRUCTS = {kind: struct.Struct("<" + "".join(f.layout for f in fields)) for kind, fields in _FIELDS.items()}

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
        return _STRUCTS[kind].pack(*values)
    except (struct.error, OverflowError) as error:
        raise FieldOutOfRange(kind.__name__, str(error)) from error


def unpack(kind: type[Any], payload: bytes) -> Any:
    """Decode a payload as a message of type `kind`; raises PayloadRefused."""
    layout = _STRUCTS[kind]
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


def payload_bytes(kind: type[Any]) -> int:
    """Payload length of a message type in bytes."""
    return _STRUCTS[kind].size
