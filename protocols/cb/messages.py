"""Messages of the CB link as frozen dataclasses; their binary layouts are in layouts.py.

Millimetres, degrees, quaternions (w, x, y, z).
"""

from dataclasses import dataclass

from protocols.cb.codes import Capability, Flag, FrameSelector, MoveKind, Output, Status

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
