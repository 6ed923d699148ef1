"""The controller's end of the CB link: allowed commands, detection of repeated requests, encoding of refusals."""

from dataclasses import dataclass

from protocols.cb.codes import ALLOWED_COMMANDS, REPLY_BIT, STATE_AFTER, VERSION, Command, SessionState, Status
from protocols.cb.errors import NothingToAnswer, PayloadRefused
from protocols.cb.frames import ChecksumFailed, Frame, FrameReader, FramingBroken, GarbageSkipped, ReaderEvent
from protocols.cb.layouts import ANSWERS, COMMAND_OF, REQUESTS, good_status, pack, unpack
from protocols.cb.messages import Hello, Refused, Reply, Request, Success
from protocols.counter import MAX_COUNT


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


def is_older(seq: int, last: int) -> bool:
    """Whether `seq` lies in the half circle before `last`: such a request was delayed and must not be executed."""
    return (seq - last) % MAX_COUNT > MAX_COUNT // 2


@dataclass
class _Last:
    """The newest request, and its encoded reply once there is one."""

    request: Frame
    reply: bytes | None = None


class ControllerSession:
    """Decodes received bytes to events. Send an event's `answer` as it is; RequestReceived needs a call of `reply`.

    `refuse_with` serves a client that must be turned away (a second one): every request gets that status.
    """

    def __init__(self, *, resynchronise: bool, refuse_with: Status | None = None) -> None:
        self._reader = FrameReader(resynchronise=resynchronise)
        self._refuse_with = refuse_with
        self.state = SessionState.NOT_GREETED
        self._last: _Last | None = None
        self._waiting: dict[int, Frame] = {}

    @property
    def half_frame_bytes(self) -> int:
        """Number of buffered bytes of an incomplete frame; after a timeout call `abandon_half_frame`."""
        return self._reader.half_frame_bytes

    def receive_data(self, data: bytes) -> list[ControllerEvent]:
        """Feed received bytes; returns the events they complete."""
        return [self._event(event) for event in self._reader.feed(data)]

    def abandon_half_frame(self) -> list[ControllerEvent]:
        """Report a timeout inside a frame: breaks a TCP stream, makes a serial line resynchronise."""
        return [self._event(event) for event in self._reader.abandon_half_frame()]

    def reply(self, seq: int, reply: Reply) -> bytes:
        """Encode the reply to request `seq` and store it, so that a repeated request gets the same bytes."""
        request = self._waiting.get(seq)
        if request is None:
            raise NothingToAnswer(f"request {seq} does not wait for a reply")
        answer = self._encode(seq, request.command, reply)
        del self._waiting[seq]
        if self._last is not None and self._last.request is request:
            self._last.reply = answer
        if not isinstance(reply, Refused) and self.state is not SessionState.BROKEN:
            self.state = STATE_AFTER.get(Command(request.command), self.state)
        return answer

    def reply_to(self, seq: int) -> bytes | None:
        """The stored reply to the newest request when its number is `seq` and it has been answered; else None."""
        last = self._last
        return last.reply if last is not None and last.request.seq == seq else None

    def announce(self, answer: Success) -> bytes:
        """Encode a message that answers no request: sequence number 0."""
        return self._encode(0, COMMAND_OF[type(answer)], answer)

    def _event(self, event: ReaderEvent) -> ControllerEvent:
        match event:
            case Frame():
                return self._request(event)
            case ChecksumFailed():
                answer = self._encode(event.seq, event.command & ~REPLY_BIT, Refused(Status.BAD_SUM))
                return BadChecksum(event.seq, event.command, answer)
            case FramingBroken():
                self.state = SessionState.BROKEN
                return event
            case GarbageSkipped():
                return event

    def _request(self, frame: Frame) -> ControllerEvent:
        if self._refuse_with is not None:
            return self._refuse(frame, self._refuse_with, "this client is not wanted")
        if frame.seq == 0:
            return self._refuse(frame, Status.BAD_FIELD, "seq 0 is reserved for what the controller says by itself")
        if frame.version != VERSION:
            return self._refuse(frame, Status.VERSION, f"version {frame.version} is not spoken here")
        last = self._last
        if last is not None and frame.seq == last.request.seq and frame == last.request:
            return DuplicatePending(frame.seq) if last.reply is None else DuplicateAnswered(frame.seq, last.reply)
        repeats = last is not None and (frame.seq == last.request.seq or is_older(frame.seq, last.request.seq))
        if repeats and frame.command != Command.HELLO:
            reason = "the same seq with another content, or a seq from before the last one"
            return self._refuse(frame, Status.DUPLICATE_SEQ_DIFFERENT_PAYLOAD, reason)
        return self._new_request(frame)

    def _new_request(self, frame: Frame) -> ControllerEvent:
        if frame.command not in REQUESTS:
            return self._refuse(frame, Status.UNKNOWN_CMD, f"command {frame.command} is unknown")
        command = Command(frame.command)
        try:
            message = unpack(REQUESTS[command], frame.payload)
        except PayloadRefused as error:
            return self._refuse(frame, error.status, error.reason)
        if command not in ALLOWED_COMMANDS[self.state]:  # VERSION, since none has been agreed
            return self._refuse(frame, Status.VERSION, "HELLO must come first")
        if isinstance(message, Hello) and not message.speaks(VERSION):
            return self._refuse(frame, Status.VERSION, f"versions {message.version_min} to {message.version_max}")
        self._last = _Last(frame)
        self._waiting[frame.seq] = frame
        return RequestReceived(frame.seq, message)

    def _refuse(self, frame: Frame, status: Status, reason: str) -> RequestRejected:
        answer = self._encode(frame.seq, frame.command & ~REPLY_BIT, Refused(status))
        return RequestRejected(frame.seq, frame.command, status, reason, answer)

    def _encode(self, seq: int, command: int, reply: Reply) -> bytes:
        if isinstance(reply, Refused):
            return Frame(command | REPLY_BIT, seq, b"", reply.status).encode()
        if command in ANSWERS and not isinstance(reply, ANSWERS[Command(command)]):
            raise NothingToAnswer(f"{type(reply).__name__} does not answer {Command(command).name}")
        return Frame(command | REPLY_BIT, seq, pack(reply), good_status(reply)).encode()
