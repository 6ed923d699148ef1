"""The client's end of the CB link: numbers requests, matches replies, repeats without ever renumbering."""

from dataclasses import dataclass
from enum import Enum

from protocols.cb.codes import REPLY_BIT, VERSION, Command, Status
from protocols.cb.errors import NotAllowedNow, NothingToAnswer, PayloadRefused, RequestOutstanding
from protocols.cb.events import (
    ClientEvent,
    GarbledReply,
    GreetingLost,
    RepeatWanted,
    ReplyReceived,
    SessionChanged,
    UnexpectedReply,
    Unsolicited,
)
from protocols.cb.frames import ChecksumFailed, Frame, FrameReader, FramingBroken, GarbageSkipped, ReaderEvent
from protocols.cb.messages import ANSWERS, COMMAND_OF, Refused, Reply, Request, Stop, Welcome, good_status, pack, unpack
from protocols.cb.sequence import following


class ClientState(Enum):
    """Where a client's end stands with its controller."""

    NOT_GREETED = "not greeted"
    GREETED = "greeted"
    BROKEN = "broken"


class ClientTrigger(Enum):
    """What changes a ClientState."""

    WELCOMED = "welcomed"
    GREETING_LOST = "greeting lost"
    GOT_FAREWELL = "got farewell"
    FRAMING_BROKE = "framing broke"


ALLOWED: dict[ClientState, frozenset[Command]] = {
    ClientState.NOT_GREETED: frozenset({Command.PING, Command.HELLO}),
    ClientState.GREETED: frozenset(Command),
    ClientState.BROKEN: frozenset(),
}
"""Which commands may be sent."""

NEXT_STATE: dict[ClientState, dict[ClientTrigger, ClientState]] = {
    ClientState.NOT_GREETED: {
        ClientTrigger.WELCOMED: ClientState.GREETED,
        ClientTrigger.GREETING_LOST: ClientState.NOT_GREETED,
        ClientTrigger.FRAMING_BROKE: ClientState.BROKEN,
    },
    ClientState.GREETED: {
        ClientTrigger.WELCOMED: ClientState.GREETED,
        ClientTrigger.GREETING_LOST: ClientState.NOT_GREETED,
        ClientTrigger.GOT_FAREWELL: ClientState.NOT_GREETED,
        ClientTrigger.FRAMING_BROKE: ClientState.BROKEN,
    },
    ClientState.BROKEN: {ClientTrigger.FRAMING_BROKE: ClientState.BROKEN},
}
"""Whatever changes the state is a row here; a reply without a row leaves it as it is."""

_TRIGGER_OF_REPLY = {
    Command.HELLO: ClientTrigger.WELCOMED,
    Command.BYE: ClientTrigger.GOT_FAREWELL,
}


@dataclass(frozen=True)
class _Outstanding:
    seq: int
    request: Request
    encoded: bytes


class ClientSession:
    """Requests out, bytes in, events out; one request at a time, and a STOP may overtake it.

    The controller remembers only the newest request. So an overtaken or abandoned request is never repeated:
    behind a newer one it would count as new.
    """

    def __init__(self, *, resynchronise: bool, known_session: int | None = None, last_seq: int = 0) -> None:
        self._reader = FrameReader(resynchronise=resynchronise)
        self._state = ClientState.NOT_GREETED
        self._session = known_session
        self._last_seq = last_seq
        self._outstanding: _Outstanding | None = None

    @property
    def state(self) -> ClientState:
        """Where this end stands with its controller."""
        return self._state

    @property
    def session(self) -> int | None:
        """The controller's session number as last greeted with; None before the first HELLO."""
        return self._session

    @property
    def last_seq(self) -> int:
        """The number of the newest request; hand it to the next connection's session."""
        return self._last_seq

    @property
    def outstanding_seq(self) -> int | None:
        """The request that has no answer yet."""
        return None if self._outstanding is None else self._outstanding.seq

    @property
    def half_frame_bytes(self) -> int:
        """How many bytes of an unfinished frame wait; when they wait too long, call `abandon_half_frame`."""
        return self._reader.half_frame_bytes

    def request(self, message: Request) -> bytes:
        """The bytes of a new request, under the next number. STOP abandons the request it overtakes.

        Raises RequestOutstanding, NotAllowedNow or FieldOutOfRange.
        """
        command = COMMAND_OF[type(message)]
        if command not in ALLOWED[self._state]:
            raise NotAllowedNow(f"{command.name} while the session is {self._state.value}")
        if self._outstanding is not None and not isinstance(message, Stop):
            waiting = self._outstanding
            raise RequestOutstanding(f"{command.name} while {waiting.seq} ({waiting.request}) has no answer")
        seq = following(self._last_seq)
        encoded = Frame(command, seq, pack(message)).encode()
        self._last_seq = seq
        self._outstanding = _Outstanding(seq, message, encoded)
        return encoded

    def repeat(self) -> bytes:
        """The outstanding request once more: the same number, the same bytes."""
        if self._outstanding is None:
            raise NothingToAnswer("no request waits for an answer")
        return self._outstanding.encoded

    def abandon(self) -> None:
        """Give the outstanding request up; an answer that comes later is an UnexpectedReply."""
        self._outstanding = None

    def receive_data(self, data: bytes) -> list[ClientEvent]:
        """Take bytes as they came; what they mean."""
        return [meaning for event in self._reader.feed(data) for meaning in self._events(event)]

    def abandon_half_frame(self) -> list[ClientEvent]:
        """Bytes stayed away too long: TCP breaks, a serial line looks for the next frame."""
        return [meaning for event in self._reader.abandon_half_frame() for meaning in self._events(event)]

    def _events(self, event: ReaderEvent) -> list[ClientEvent]:
        match event:
            case Frame():
                return self._frame(event)
            case FramingBroken():
                self._advance(ClientTrigger.FRAMING_BROKE)
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
        return self._answered(waiting, command, reply)

    def _answered(self, waiting: _Outstanding, command: Command, reply: Reply) -> list[ClientEvent]:
        if isinstance(reply, Refused) and reply.status == Status.BAD_SUM:
            return [RepeatWanted(waiting.seq)]
        self._outstanding = None
        answered: list[ClientEvent] = [ReplyReceived(waiting.seq, waiting.request, reply)]
        if isinstance(reply, Refused):
            if reply.status == Status.VERSION and self._state is ClientState.GREETED:
                self._advance(ClientTrigger.GREETING_LOST)
                answered.insert(0, GreetingLost())
            return answered
        self._advance(_TRIGGER_OF_REPLY.get(command))
        if isinstance(reply, Welcome):
            before, self._session = self._session, reply.session
            if before is not None and before != reply.session:
                answered.insert(0, SessionChanged(before, reply.session))
        return answered

    def _advance(self, trigger: ClientTrigger | None) -> None:
        if trigger is not None:
            self._state = NEXT_STATE[self._state].get(trigger, self._state)


def _reply(command: Command, frame: Frame) -> Reply:
    """The reply in a frame; raises PayloadRefused. A status that is not the good one has an empty payload."""
    kind = ANSWERS[command]
    if frame.status in (Status.OK, Status.ACCEPTED):
        answer: Reply = unpack(kind, frame.payload)
        if not isinstance(answer, Refused) and frame.status != good_status(answer):
            raise PayloadRefused(kind.__name__, f"it came with status {frame.status}", Status.BAD_FIELD)
        return answer
    if frame.payload:
        raise PayloadRefused(kind.__name__, f"a refusal with {len(frame.payload)} bytes of payload", Status.BAD_LEN)
    return Refused(frame.status)
