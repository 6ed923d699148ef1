"""Every message once, beside its literal bytes (checked against by_hand.py, too)."""

from typing import NamedTuple

from protocols.cb.codes import Capability, Flag, FrameSelector, MoveKind, Output, Status
from protocols.cb.messages import (
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
    Success,
    Welcome,
)

FLANGE = ((812.5, -40.25, 1033.0), (0.5, -0.5, 0.5, -0.5), (-1, 0, 2, -3))
NO_AXES = (8999999488.0,) * 6
AXES_BYTES = "00 00 28 41 00 00 a2 c1 00 00 f0 41 00 00 00 00 00 00 b4 c2 00 00 34 43" + "46 1c 06 50" * 6
TITLE, CAUSE = b"Position outside reach".ljust(80, b"\0"), b"axis 3".ljust(80, b"\0")
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
    message: Request | Success
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
    Row(
        "move joints",
        11,
        MoveJoints((10.5, -20.25, 30.0, 0.0, -90.0, 180.0), NO_AXES, 50.0),
        "43 42 01 0a 0b 00 00 00 34 00 9d be" + AXES_BYTES + "00 00 48 42",
        (10.5, -20.25, 30, 0, -90, 180, *(9e9,) * 6, 50),
    ),
    Row("get error", 12, GetError(), "43 42 01 0b 0c 00 00 00 00 00 9d 92"),
    Row("set output", 13, SetOutput(Output.TRIGGER, True), "43 42 01 0c 0d 00 00 00 04 00 a6 40 02 00 01 00", (2, 1)),
    Row("get setup", 14, GetSetup(), "43 42 01 0d 0e 00 00 00 00 00 a1 ac"),
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
    Row("joint move accepted", 11, JointMoveAccepted(), "43 42 01 8a 0b 00 01 00 00 00 1d 0d", status=1),
    Row(
        "error",
        12,
        ErrorText(50050, "Position outside reach", "axis 3"),
        "43 42 01 8b 0c 00 00 00 a4 00 b0 ce 82 c3 00 00" + (TITLE + CAUSE).hex(),
        (50050, *TITLE, *CAUSE),
    ),
    Row("output done", 13, OutputDone(), "43 42 01 8c 0d 00 00 00 00 00 20 23"),
    Row(
        "setup",
        14,
        Setup(1.5, (0.0, 0.0, 60.0), 400.0, 1000.0, 270.0, (-1600.0, -1600.0, 0.0), (1600.0, 1600.0, 2200.0)),
        "43 42 01 8d 0e 00 00 00 34 00 a2 9e"
        + "00 00 c0 3f 00 00 00 00 00 00 00 00 00 00 70 42 00 00 c8 43 00 00 7a 44 00 00 87 43"
        + "00 00 c8 c4 00 00 c8 c4 00 00 00 00 00 00 c8 44 00 00 c8 44 00 80 09 45",
        (1.5, 0, 0, 60, 400, 1000, 270, -1600, -1600, 0, 1600, 1600, 2200),
    ),
)

ALL_ROWS = REQUEST_ROWS + REPLY_ROWS
