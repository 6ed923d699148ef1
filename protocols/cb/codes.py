"""Command, status, flag and selector codes of the CB link."""

from enum import Enum, IntEnum, IntFlag

VERSION = 1
"""Protocol version implemented here."""

REPLY_BIT = 0x80
"""Set in a reply's command byte, beside its request's command."""


class Command(IntEnum):
    """Commands a client can send."""

    PING = 1
    HELLO = 2
    GET_POSE = 3
    MOVE = 4
    STOP = 5
    STATUS = 6
    ARM = 7
    GET_JOINTS = 8
    BYE = 9
    MOVE_JOINTS = 10
    GET_ERROR = 11
    SET_OUTPUT = 12
    GET_SETUP = 13


class Status(IntEnum):
    """Result of a request. Replies other than OK and ACCEPTED have an empty payload."""

    OK = 0
    ACCEPTED = 1
    UNKNOWN_CMD = 2
    BAD_LEN = 3
    BAD_SUM = 4
    VERSION = 5
    BUSY = 6
    NOT_ARMED = 7
    WRONG_MODE = 8
    MOTORS_OFF = 9
    UNREACHABLE = 10
    OUTSIDE_BOX = 11
    ABORTED = 12
    MOTION_ERROR = 13
    SPEED = 14
    DUPLICATE_SEQ_DIFFERENT_PAYLOAD = 15
    ESTOP = 16
    BAD_FIELD = 17
    NO_LOAD = 18
    INTERLOCK = 19


class Flag(IntFlag):
    """Controller state as 16 bits."""

    MOTORS_ON = 1
    AUTO = 2
    ESTOP = 4
    MOVING = 8
    IN_POSITION = 16
    ARMED = 32
    TASK_RUNNING = 64
    SPEED_LIMITED = 128


class FrameSelector(IntEnum):
    """Tool and work object of a requested pose."""

    TOOL0_WOBJ0 = 0
    CELL = 1


class MoveKind(IntEnum):
    JOINT = 1
    LINEAR = 2


class Capability(IntFlag):
    """Capabilities a controller reports in its HELLO reply."""

    MOVES = 1
    STOPS_DURING_MOTION = 2
    JOINTS = 4
    ANNOUNCES_END_OF_MOVE = 8
    MOVES_JOINTS = 16
    REPORTS_ERRORS = 32
    SWITCHES_OUTPUTS = 64
    REPORTS_SETUP = 128


class Output(IntEnum):
    """An output of the controller that SET_OUTPUT switches; the controller's settings name its signal."""

    LIGHT = 1
    TRIGGER = 2


class SessionState(Enum):
    """Of one end, alike at both: whether HELLO was answered; BROKEN for good once the stream cannot be split."""

    NOT_GREETED = "not greeted"
    GREETED = "greeted"
    BROKEN = "broken"


ALLOWED_COMMANDS: dict[SessionState, frozenset[Command]] = {
    SessionState.NOT_GREETED: frozenset({Command.PING, Command.HELLO}),
    SessionState.GREETED: frozenset(Command),
    SessionState.BROKEN: frozenset(),
}
"""Commands that a client may send, and a controller hands up, in each state."""

STATE_AFTER = {Command.HELLO: SessionState.GREETED, Command.BYE: SessionState.NOT_GREETED}
"""By the command that was answered; after any other the state is the same. Refusals leave it, too."""
