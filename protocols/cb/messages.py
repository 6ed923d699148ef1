"""Messages of the CB link as frozen dataclasses: their fields in the order of the wire, laid out as their types say.

Millimetres, degrees, quaternions (w, x, y, z).
"""

from dataclasses import dataclass
from typing import Annotated

from protocols.cb.codes import Capability, Command, Flag, FrameSelector, MoveKind, Output, Status

Three = tuple[float, float, float]
Four = tuple[float, float, float, float]
Six = tuple[float, float, float, float, float, float]
ConfData = tuple[int, int, int, int]
LongNumber = Annotated[int, "I"]
"""Of 32 bits; an int has 16. What is annotated has this layout of `struct` in place of its type's in layouts.py."""

_STATUS_NAMES = {int(status): status.name for status in Status}

T_MS_WRAP = 8_000_000
"""The controller's milliseconds since HELLO wrap here, because RAPID's num is exact only up to 2^23."""


class Request:
    """Base of what a client sends."""


class Success:
    """Base of what a controller replies when it has done what was asked."""


@dataclass(frozen=True)
class Ping(Request):
    """Connection check and heartbeat."""


@dataclass(frozen=True)
class Hello(Request):
    """Versions and id of the client; the first request of a connection. `version_max` 0 means `version_min`."""

    version_min: int
    version_max: int
    client_id: int
    flags: int = 0

    def speaks(self, version: int) -> bool:
        return self.version_min <= version <= (self.version_max or self.version_min)


@dataclass(frozen=True)
class GetPose(Request):
    """Request the pose of the flange (or of the cell's tool)."""

    frame: FrameSelector = FrameSelector.TOOL0_WOBJ0


@dataclass(frozen=True)
class Move(Request):
    """Move to a stop point. `configuration` is confdata, `external_axes` in degrees or mm, 9e9 where unused."""

    position_mm: Three
    quaternion_wxyz: Four
    configuration: ConfData
    external_axes: Six
    speed_mm_s: float
    kind: Annotated[MoveKind, "Hxx"]


@dataclass(frozen=True)
class Stop(Request):
    """Stop at once and drop the move."""


@dataclass(frozen=True)
class GetStatus(Request):
    """Request the flags and the progress of the last move."""


@dataclass(frozen=True)
class SetArmed(Request):
    """Allow or forbid motion in this session."""

    session: int
    armed: bool


@dataclass(frozen=True)
class GetJoints(Request):
    """Request the axis angles."""


@dataclass(frozen=True)
class Bye(Request):
    """The client disconnects; the controller disarms."""


@dataclass(frozen=True)
class MoveJoints(Request):
    """Move all axes to these angles, to a stop point (MoveAbsJ): no posture, no singularity."""

    axes_deg: Six
    external_axes: Six
    speed_mm_s: float


@dataclass(frozen=True)
class GetError(Request):
    """Request ABB's number and text of the error that ended the last move."""


@dataclass(frozen=True)
class SetOutput(Request):
    """Switch an output that the controller's settings name."""

    output: Output
    on: bool


@dataclass(frozen=True)
class GetSetup(Request):
    """Request the settings of the modules that concern motion."""


@dataclass(frozen=True)
class Pong(Success):
    """Reply to PING."""


@dataclass(frozen=True)
class Welcome(Success):
    """Reply to HELLO. A `session` other than the last one means that the controller restarted."""

    version: int
    capabilities: Capability
    session: int
    build: int
    rawbytes_max: int
    robot_axes: int


@dataclass(frozen=True)
class Pose(Success):
    """Reply to GET_POSE. `t_ms` counts from HELLO and wraps at 8 000 000."""

    position_mm: Three
    quaternion_wxyz: Four
    configuration: ConfData
    external_axes: Six
    t_ms: LongNumber
    flags: Annotated[Flag, "Hxx"]


@dataclass(frozen=True)
class MoveAccepted(Success):
    """Reply to MOVE: the move begins; GET_STATUS reports its end. Its status is ACCEPTED, not OK."""


@dataclass(frozen=True)
class Stopped(Success):
    """Reply to STOP."""


@dataclass(frozen=True)
class Report(Success):
    """Reply to STATUS: number and result of the last finished move, progress of the current one.

    `finished_seq` is 0 when no move has ended in this session; `progress_per_mille` is 1000 when none is in progress.
    """

    flags: Flag
    finished_seq: int
    finished_status: int
    progress_per_mille: int
    t_ms: LongNumber


@dataclass(frozen=True)
class ArmingDone(Success):
    """Reply to ARM."""


@dataclass(frozen=True)
class Joints(Success):
    """Reply to GET_JOINTS: six arm axes in degrees, six external axes (9e9 where unused)."""

    axes_deg: Six
    external_axes: Six


@dataclass(frozen=True)
class Farewell(Success):
    """Reply to BYE."""


@dataclass(frozen=True)
class JointMoveAccepted(Success):
    """Reply to MOVE_JOINTS: the move begins, as after MOVE."""


@dataclass(frozen=True)
class ErrorText(Success):
    """Reply to GET_ERROR: number as in the event log (50050: domain 5, number 50; 0: none), title and cause."""

    number: LongNumber
    title: str
    cause: str


@dataclass(frozen=True)
class OutputDone(Success):
    """Reply to SET_OUTPUT."""


@dataclass(frozen=True)
class Setup(Success):
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


Reply = Success | Refused

MESSAGES: dict[Command, tuple[type[Request], type[Success]]] = {
    Command.PING: (Ping, Pong),
    Command.HELLO: (Hello, Welcome),
    Command.GET_POSE: (GetPose, Pose),
    Command.MOVE: (Move, MoveAccepted),
    Command.STOP: (Stop, Stopped),
    Command.STATUS: (GetStatus, Report),
    Command.ARM: (SetArmed, ArmingDone),
    Command.GET_JOINTS: (GetJoints, Joints),
    Command.BYE: (Bye, Farewell),
    Command.MOVE_JOINTS: (MoveJoints, JointMoveAccepted),
    Command.GET_ERROR: (GetError, ErrorText),
    Command.SET_OUTPUT: (SetOutput, OutputDone),
    Command.GET_SETUP: (GetSetup, Setup),
}
"""Types of each command's request, and of the reply when it succeeded."""
