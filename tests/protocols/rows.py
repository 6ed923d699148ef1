"""Every message once, beside its literal bytes (checked against by_hand.py, too)."""

from typing import NamedTuple

from protocols.cb.codes import Capability, Flag, FrameSelector, MoveKind, Status
from protocols.cb.messages import (
    Answer,
    ArmingDone,
    Bye,
    Farewell,
    GetJoints,
    GetPose,
    GetStatus,
    Hello,
    Joints,
    Move,
    MoveAccepted,
    Ping,
    Pong,
    Pose,
    Report,
    Request,
    SetArmed,
    Stop,
    Stopped,
    Welcome,
)

FLANGE = ((812.5, -40.25, 1033.0), (0.5, -0.5, 0.5, -0.5), (-1, 0, 2, -3))
NO_AXES = (8999999488.0,) * 6
FLANGE_BYTES = (
    "00 20 4b 44 00 00 21 c2 00 20 81 44  00 00 00 3f 00 00 00 bf 00 00 00 3f 00 00 00 bf  ff ff 00 00 02 00 fd ff"
    + " 46 1c 06 50" * 6
)
FLANGE_VALUES = (812.5, -40.25, 1033, 0.5, -0.5, 0.5, -0.5, -1, 0, 2, -3, 9e9, 9e9, 9e9, 9e9, 9e9, 9e9)
STANDS = Flag.MOTORS_ON | Flag.AUTO | Flag.IN_POSITION | Flag.TASK_RUNNING | Flag.SPEED_LIMITED


class Row(NamedTuple):
    """A message under a number, its bytes, and what by_hand.py needs to make them again."""

    name: str
    seq: int
    message: Request | Answer
    hex_bytes: str
    values: tuple[float, ...] = ()
    status: int = 0

    @property
    def encoded(self) -> bytes:
        return bytes.fromhex(self.hex_bytes)


REQUEST_ROWS = (
    Row("ping", 1, Ping(), "43 42 01 01 01 00 00 00 00 00 88 0a"),
    Row(
        "hello",
        2,
        Hello(1, 1, 517, 0),
        "43 42 01 02 02 00 00 00 08 00 9b e3 01 00 01 00 05 02 00 00",
        (1, 1, 517, 0),
    ),
    Row("get pose", 300, GetPose(FrameSelector.CELL), "43 42 01 03 2c 01 00 00 02 00 b9 97 01 00", (1,)),
    Row(
        "move",
        65535,
        Move(*FLANGE, NO_AXES, 100.0, MoveKind.JOINT),
        "43 42 01 04 ff ff 00 00 44 00 a6 68" + FLANGE_BYTES + "00 00 c8 42 01 00 00 00",
        (*FLANGE_VALUES, 100, 1, 0),
    ),
    Row("stop", 6, Stop(), "43 42 01 05 06 00 00 00 00 00 91 44"),
    Row("status", 7, GetStatus(), "43 42 01 06 07 00 00 00 00 00 93 51"),
    Row("arm", 8, SetArmed(9, True), "43 42 01 07 08 00 00 00 04 00 a3 f2 09 00 01 00", (9, 1)),
    Row("get joints", 9, GetJoints(), "43 42 01 08 09 00 00 00 00 00 97 6b"),
    Row("bye", 10, Bye(), "43 42 01 09 0a 00 00 00 00 00 99 78"),
)

REPLY_ROWS = (
    Row("pong", 1, Pong(), "43 42 01 81 01 00 00 00 00 00 09 8d"),
    Row(
        "welcome",
        2,
        Welcome(1, Capability(7), 9, 20, 1024, 6),
        "43 42 01 82 02 00 00 00 0c 00 46 f2 01 00 07 00 09 00 14 00 00 04 06 00",
        (1, 7, 9, 20, 1024, 6),
    ),
    Row(
        "pose",
        300,
        Pose(*FLANGE, NO_AXES, 7999999, STANDS),
        "43 42 01 83 2c 01 00 00 44 00 a6 72" + FLANGE_BYTES + "ff 11 7a 00 d3 00 00 00",
        (*FLANGE_VALUES, 7999999, 0xD3, 0),
    ),
    Row("accepted", 65535, MoveAccepted(), "43 42 01 84 ff ff 01 00 00 00 0c a0", status=1),
    Row("stopped", 6, Stopped(), "43 42 01 85 06 00 00 00 00 00 12 c7"),
    Row(
        "report",
        7,
        Report(STANDS, 65535, Status.ABORTED, 437, 70000),
        "43 42 01 86 07 00 00 00 0c 00 39 fa d3 00 ff ff 0c 00 b5 01 70 11 01 00",
        (0xD3, 65535, 12, 437, 70000),
    ),
    Row("arming done", 8, ArmingDone(), "43 42 01 87 08 00 00 00 00 00 16 e1"),
    Row(
        "joints",
        9,
        Joints((10.5, -20.25, 30.0, 0.0, -90.0, 180.0), NO_AXES),
        "43 42 01 88 09 00 00 00 30 00 8b 97 00 00 28 41 00 00 a2 c1 00 00 f0 41 00 00 00 00 00 00 b4 c2 00 00 34 43"
        + "46 1c 06 50" * 6,
        (10.5, -20.25, 30, 0, -90, 180, *(9e9,) * 6),
    ),
    Row("farewell", 10, Farewell(), "43 42 01 89 0a 00 00 00 00 00 1a fb"),
)

ALL_ROWS = REQUEST_ROWS + REPLY_ROWS
