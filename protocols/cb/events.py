"""What the sessions report. Framing events come from frames.py unchanged."""

from dataclasses import dataclass

from protocols.cb.codes import Status
from protocols.cb.frames import ChecksumFailed, FramingBroken, GarbageSkipped
from protocols.cb.messages import Reply, Request

# --- the client's ---


@dataclass(frozen=True)
class ReplyReceived:
    """The outstanding request is answered."""

    seq: int
    request: Request
    reply: Reply


@dataclass(frozen=True)
class RepeatWanted:
    """The controller got our request with a wrong checksum and did nothing: send `repeat()`."""

    seq: int


@dataclass(frozen=True)
class SessionChanged:
    """The controller greets with another session number than before: it restarted, and knows of no move of ours."""

    before: int
    now: int


@dataclass(frozen=True)
class GreetingLost:
    """The controller wants HELLO again: it restarted behind a line that has no connection."""


@dataclass(frozen=True)
class Unsolicited:
    """The controller speaks by itself (seq 0)."""

    reply: Reply
    command: int


@dataclass(frozen=True)
class UnexpectedReply:
    """A well-formed reply to nothing we wait for: late, repeated, or meant for another."""

    seq: int
    command: int


@dataclass(frozen=True)
class GarbledReply:
    """A whole frame that is not what its command promises; to repeat the request would not help."""

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

# --- the controller's ---


@dataclass(frozen=True)
class RequestReceived:
    """A new request: do it and call `reply(seq, ...)`."""

    seq: int
    message: Request


@dataclass(frozen=True)
class RequestRefused:
    """The session answered a request by itself; `answer` is what to send."""

    seq: int
    command: int
    status: Status
    reason: str
    answer: bytes


@dataclass(frozen=True)
class BadChecksum:
    """A frame with a wrong sum; `answer` (BAD_SUM) is what to send. Nothing was done."""

    seq: int
    command: int
    answer: bytes


@dataclass(frozen=True)
class DuplicateAnswered:
    """The last request came again: `answer`, the stored reply, is what to send. It is not done twice."""

    seq: int
    answer: bytes


@dataclass(frozen=True)
class DuplicatePending:
    """The last request came again before its reply was ready: nothing to send, the reply will come."""

    seq: int


ControllerEvent = (
    RequestReceived
    | RequestRefused
    | BadChecksum
    | DuplicateAnswered
    | DuplicatePending
    | GarbageSkipped
    | FramingBroken
)
