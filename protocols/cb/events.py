"""Events reported by the client and controller sessions. Framing events of frames.py pass through unchanged."""

from dataclasses import dataclass

from protocols.cb.codes import Status
from protocols.cb.frames import ChecksumFailed, FramingBroken, GarbageSkipped
from protocols.cb.messages import Reply, Request

# --- client ---


@dataclass(frozen=True)
class ReplyReceived:
    """The outstanding request was answered."""

    seq: int
    request: Request
    reply: Reply


@dataclass(frozen=True)
class RepeatWanted:
    """The controller received the request with a wrong checksum and did nothing: send `repeat()`."""

    seq: int


@dataclass(frozen=True)
class SessionChanged:
    """The controller's session number changed: it restarted and has forgotten earlier moves."""

    before: int
    now: int


@dataclass(frozen=True)
class GreetingLost:
    """The controller requires HELLO again: it restarted, on a serial line, which shows no disconnection."""


@dataclass(frozen=True)
class Unsolicited:
    """A message the controller sent by itself (sequence number 0)."""

    reply: Reply
    command: int


@dataclass(frozen=True)
class UnexpectedReply:
    """A well-formed reply that matches no outstanding request: late or repeated."""

    seq: int
    command: int


@dataclass(frozen=True)
class GarbledReply:
    """A complete frame whose payload does not fit its command; repeating the request would not help."""

    seq: int
    reason: str


ClientEvent = (
    ReplyReceived
    | RepeatWanted
    | SessionChanged
    | GreetingLost
    | Unsolicited
    | UnexpectedReply
    | GarbledReply
    | ChecksumFailed
    | GarbageSkipped
    | FramingBroken
)

# --- controller ---


@dataclass(frozen=True)
class RequestReceived:
    """A new request: execute it and call `reply(seq, ...)`."""

    seq: int
    message: Request


@dataclass(frozen=True)
class RequestRejected:
    """The session refused a request by itself; send `answer`."""

    seq: int
    command: int
    status: Status
    reason: str
    answer: bytes


@dataclass(frozen=True)
class BadChecksum:
    """A frame had a wrong checksum and was ignored; send `answer` (BAD_SUM)."""

    seq: int
    command: int
    answer: bytes


@dataclass(frozen=True)
class DuplicateAnswered:
    """The last request was repeated and not executed again; send `answer`, the stored reply."""

    seq: int
    answer: bytes


@dataclass(frozen=True)
class DuplicatePending:
    """The last request was repeated before its reply was ready; send nothing, the reply follows."""

    seq: int


ControllerEvent = (
    RequestReceived
    | RequestRejected
    | BadChecksum
    | DuplicateAnswered
    | DuplicatePending
    | GarbageSkipped
    | FramingBroken
)
