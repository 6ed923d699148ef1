"""The controller's end of the CB link: who may ask what, what was asked before, and how refusals look."""

from dataclasses import dataclass
from enum import Enum

from protocols.cb.codes import REPLY_BIT, VERSION, Command, Status
from protocols.cb.errors import NothingToAnswer, PayloadRefused
from protocols.cb.events import (
    BadChecksum,
    ControllerEvent,
    DuplicateAnswered,
    DuplicatePending,
    RequestReceived,
    RequestRefused,
)
from protocols.cb.frames import ChecksumFailed, Frame, FrameReader, FramingBroken, GarbageSkipped, ReaderEvent
from protocols.cb.messages import (
    ANSWERS,
    COMMAND_OF,
    REQUESTS,
    Answer,
    Hello,
    Refused,
    Reply,
    good_status,
    pack,
    unpack,
)
from protocols.cb.sequence import is_older


class ControllerState(Enum):
    """Where a controller's end stands with its client."""

    AWAITING_HELLO = "awaiting HELLO"
    GREETED = "greeted"
    BROKEN = "broken"


class ControllerTrigger(Enum):
    """What changes a ControllerState."""

    WELCOMED = "welcomed"
    SAID_FAREWELL = "said farewell"
    FRAMING_BROKE = "framing broke"


ALLOWED: dict[ControllerState, frozenset[Command]] = {
    ControllerState.AWAITING_HELLO: frozenset({Command.PING, Command.HELLO}),
    ControllerState.GREETED: frozenset(Command),
    ControllerState.BROKEN: frozenset(),
}
"""Which commands are handed up; any other is answered with VERSION: the versions have not been agreed."""

NEXT_STATE: dict[ControllerState, dict[ControllerTrigger, ControllerState]] = {
    ControllerState.AWAITING_HELLO: {
        ControllerTrigger.WELCOMED: ControllerState.GREETED,
        ControllerTrigger.FRAMING_BROKE: ControllerState.BROKEN,
    },
    ControllerState.GREETED: {
        ControllerTrigger.WELCOMED: ControllerState.GREETED,
        ControllerTrigger.SAID_FAREWELL: ControllerState.AWAITING_HELLO,
        ControllerTrigger.FRAMING_BROKE: ControllerState.BROKEN,
    },
    ControllerState.BROKEN: {ControllerTrigger.FRAMING_BROKE: ControllerState.BROKEN},
}
"""Whatever changes the state is a row here; an answer without a row leaves it as it is."""

_TRIGGER_OF_ANSWER = {
    Command.HELLO: ControllerTrigger.WELCOMED,
    Command.BYE: ControllerTrigger.SAID_FAREWELL,
}


@dataclass
class _Last:
    """The newest request and, once there is one, its reply's bytes."""

    request: Frame
    reply: bytes | None = None


class ControllerSession:
    """Bytes in, events out. Every event with an `answer` has the bytes to send; a RequestReceived wants `reply`.

    `refuse_with` makes it the session of a client that is not wanted (a second one): every request gets that status.
    """

    def __init__(self, *, resynchronise: bool, refuse_with: Status | None = None) -> None:
        self._reader = FrameReader(resynchronise=resynchronise)
        self._refuse_with = refuse_with
        self._state = ControllerState.AWAITING_HELLO
        self._last: _Last | None = None
        self._waiting: dict[int, Frame] = {}

    @property
    def state(self) -> ControllerState:
        """Where this end stands with its client."""
        return self._state

    @property
    def half_frame_bytes(self) -> int:
        """How many bytes of an unfinished frame wait; when they wait too long, call `abandon_half_frame`."""
        return self._reader.half_frame_bytes

    def receive_data(self, data: bytes) -> list[ControllerEvent]:
        """Take bytes as they came; what they mean."""
        return [self._event(event) for event in self._reader.feed(data)]

    def abandon_half_frame(self) -> list[ControllerEvent]:
        """Bytes stayed away too long: TCP breaks, a serial line looks for the next frame."""
        return [self._event(event) for event in self._reader.abandon_half_frame()]

    def reply(self, seq: int, reply: Reply) -> bytes:
        """The bytes that answer request `seq`; kept, so that a repeated request gets the same ones."""
        request = self._waiting.get(seq)
        if request is None:
            raise NothingToAnswer(f"request {seq} does not wait for a reply")
        answer = self._encode(seq, request.command, reply)
        del self._waiting[seq]
        if self._last is not None and self._last.request is request:
            self._last.reply = answer
        if not isinstance(reply, Refused):
            self._advance(_TRIGGER_OF_ANSWER.get(Command(request.command)))
        return answer

    def unsolicited(self, answer: Answer) -> bytes:
        """A frame the client did not ask for: seq 0."""
        return self._encode(0, COMMAND_OF[type(answer)], answer)

    def _event(self, event: ReaderEvent) -> ControllerEvent:
        match event:
            case Frame():
                return self._request(event)
            case ChecksumFailed():
                answer = self._encode(event.seq, event.command & ~REPLY_BIT, Refused(Status.BAD_SUM))
                return BadChecksum(event.seq, event.command, answer)
            case FramingBroken():
                self._advance(ControllerTrigger.FRAMING_BROKE)
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
        if last is not None and frame.command != Command.HELLO and not self._is_new(frame.seq, last.request.seq):
            reason = "the same seq with another content, or a seq from before the last one"
            return self._refuse(frame, Status.DUPLICATE_SEQ_DIFFERENT_PAYLOAD, reason)
        return self._new_request(frame)

    @staticmethod
    def _is_new(seq: int, last_seq: int) -> bool:
        return seq != last_seq and not is_older(seq, last_seq)

    def _new_request(self, frame: Frame) -> ControllerEvent:
        if frame.command not in REQUESTS:
            return self._refuse(frame, Status.UNKNOWN_CMD, f"command {frame.command} is unknown")
        command = Command(frame.command)
        try:
            message = unpack(REQUESTS[command], frame.payload)
        except PayloadRefused as error:
            return self._refuse(frame, error.status, error.reason)
        if command not in ALLOWED[self._state]:
            return self._refuse(frame, Status.VERSION, "HELLO must come first")
        if isinstance(message, Hello) and not message.speaks(VERSION):
            return self._refuse(frame, Status.VERSION, f"versions {message.version_min} to {message.version_max}")
        self._last = _Last(frame)
        self._waiting[frame.seq] = frame
        return RequestReceived(frame.seq, message)

    def _refuse(self, frame: Frame, status: Status, reason: str) -> RequestRefused:
        answer = self._encode(frame.seq, frame.command & ~REPLY_BIT, Refused(status))
        return RequestRefused(frame.seq, frame.command, status, reason, answer)

    def _encode(self, seq: int, command: int, reply: Reply) -> bytes:
        if isinstance(reply, Refused):
            return Frame(command | REPLY_BIT, seq, b"", reply.status).encode()
        if command in ANSWERS and not isinstance(reply, ANSWERS[Command(command)]):
            raise NothingToAnswer(f"{type(reply).__name__} does not answer {Command(command).name}")
        return Frame(command | REPLY_BIT, seq, pack(reply), good_status(reply)).encode()

    def _advance(self, trigger: ControllerTrigger | None) -> None:
        if trigger is not None:
            self._state = NEXT_STATE[self._state].get(trigger, self._state)
