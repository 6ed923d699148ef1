"""The client's end of the CB link: numbers requests, matches replies, and repeats a request under its old number."""

from dataclasses import dataclass

from protocols.cb.codes import (
    ALLOWED_COMMANDS,
    REPLY_BIT,
    STATE_AFTER,
    VERSION,
    Capability,
    Command,
    SessionState,
    Status,
)
from protocols.cb.errors import NotAllowedNow, NothingToAnswer, PayloadRefused, RequestOutstanding
from protocols.cb.frames import ChecksumFailed, Frame, FrameReader, FramingBroken, GarbageSkipped, ReaderEvent
from protocols.cb.layouts import ANSWERS, COMMAND_OF, good_status, pack, unpack
from protocols.cb.messages import Refused, Reply, Request, Stop, Welcome
from protocols.counter import next_count


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
    | GreetingLost
    | Unsolicited
    | UnexpectedReply
    | GarbledReply
    | ChecksumFailed
    | GarbageSkipped
    | FramingBroken
)


@dataclass(frozen=True)
class _Outstanding:
    seq: int
    request: Request
    encoded: bytes


class ClientSession:
    """Encodes requests and decodes received bytes. One request is outstanding at a time; only STOP may overtake it.

    The controller remembers only the newest request, so an overtaken or abandoned request must not be repeated: the
    controller would take it for a new one.
    """

    def __init__(self, *, resynchronise: bool, last_seq: int = 0) -> None:
        self._reader = FrameReader(resynchronise=resynchronise)
        self.state = SessionState.NOT_GREETED
        self.session: int | None = None
        """Session number in the controller's reply to HELLO, another one after a restart; None before it."""
        self.last_seq = last_seq
        """Sequence number of the newest request; pass it to the session of the next connection."""
        self._outstanding: _Outstanding | None = None
        self.capabilities = Capability(0)
        """What the controller can do, from its reply to HELLO."""

    @property
    def outstanding_seq(self) -> int | None:
        """Sequence number of the request that has no reply yet; None when there is none."""
        return None if self._outstanding is None else self._outstanding.seq

    @property
    def half_frame_bytes(self) -> int:
        """Number of buffered bytes of an incomplete frame; after a timeout call `abandon_half_frame`."""
        return self._reader.half_frame_bytes

    def request(self, message: Request) -> bytes:
        """Encode a new request under the next sequence number. STOP abandons the request it overtakes.

        Raises RequestOutstanding, NotAllowedNow or FieldOutOfRange.
        """
        command = COMMAND_OF[type(message)]
        if command not in ALLOWED_COMMANDS[self.state]:
            raise NotAllowedNow(f"{command.name} while the session is {self.state.value}")
        if self._outstanding is not None and not isinstance(message, Stop):
            waiting = self._outstanding
            raise RequestOutstanding(f"{command.name} while {waiting.seq} ({waiting.request}) has no answer")
        seq = next_count(self.last_seq)
        encoded = Frame(command, seq, pack(message)).encode()
        self.last_seq = seq
        self._outstanding = _Outstanding(seq, message, encoded)
        return encoded

    def repeat(self) -> bytes:
        """Encode the outstanding request again, with the same number and the same bytes."""
        if self._outstanding is None:
            raise NothingToAnswer("no request waits for an answer")
        return self._outstanding.encoded

    def abandon(self) -> None:
        """Give up the outstanding request; a late reply to it becomes an UnexpectedReply."""
        self._outstanding = None

    def receive_data(self, data: bytes) -> list[ClientEvent]:
        """Feed received bytes; returns the events they complete."""
        return [meaning for event in self._reader.feed(data) for meaning in self._events(event)]

    def abandon_half_frame(self) -> list[ClientEvent]:
        """Report a timeout inside a frame: breaks a TCP stream, makes a serial line resynchronise."""
        return [meaning for event in self._reader.abandon_half_frame() for meaning in self._events(event)]

    def _events(self, event: ReaderEvent) -> list[ClientEvent]:
        match event:
            case Frame():
                return self._frame(event)
            case FramingBroken():
                self.state = SessionState.BROKEN
                return [event]
            case ChecksumFailed() | GarbageSkipped():
                return [event]

    def _frame(self, frame: Frame) -> list[ClientEvent]:
        number = frame.command & ~REPLY_BIT
        if frame.version != VERSION:
            return [GarbledReply(frame.seq, f"its version is {frame.version}, not {VERSION}")]
        if not frame.command & REPLY_BIT or number not in ANSWERS:
            return [GarbledReply(frame.seq, f"{frame.command:#04x} is no reply")]
        command = Command(number)
        waiting = self._outstanding
        expected = waiting is not None and waiting.seq == frame.seq and COMMAND_OF[type(waiting.request)] == command
        if frame.seq != 0 and not expected:
            return [UnexpectedReply(frame.seq, frame.command)]
        try:
            reply = _reply(command, frame)
        except PayloadRefused as error:
            return [GarbledReply(frame.seq, str(error))]
        if waiting is None or frame.seq == 0:
            return [Unsolicited(reply, command)]
        return self._handle_reply(waiting, command, reply)

    def _handle_reply(self, waiting: _Outstanding, command: Command, reply: Reply) -> list[ClientEvent]:
        if isinstance(reply, Refused) and reply.status == Status.BAD_SUM:
            return [RepeatWanted(waiting.seq)]
        self._outstanding = None
        answered: list[ClientEvent] = [ReplyReceived(waiting.seq, waiting.request, reply)]
        if isinstance(reply, Refused):
            if reply.status == Status.VERSION and self.state is SessionState.GREETED:
                self.state = SessionState.NOT_GREETED
                answered.insert(0, GreetingLost())
            return answered
        if self.state is not SessionState.BROKEN:
            self.state = STATE_AFTER.get(command, self.state)
        if isinstance(reply, Welcome):
            self.capabilities, self.session = reply.capabilities, reply.session
        return answered


def _reply(command: Command, frame: Frame) -> Reply:
    """Decode the reply in a frame; raises PayloadRefused. A reply with a refusing status must have an empty payload."""
    kind = ANSWERS[command]
    if frame.status in (Status.OK, Status.ACCEPTED):
        answer: Reply = unpack(kind, frame.payload)
        if not isinstance(answer, Refused) and frame.status != good_status(answer):
            raise PayloadRefused(kind.__name__, f"it came with status {frame.status}", Status.BAD_FIELD)
        return answer
    if frame.payload:
        raise PayloadRefused(kind.__name__, f"a refusal with {len(frame.payload)} bytes of payload", Status.BAD_LEN)
    return Refused(frame.status)
