"""A small controller with real sockets or a real pty, and the faults a test wants."""

import asyncio
import contextlib
import os
import tty
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from calibration.transforms import transform_from_quaternion
from protocols.cb.codes import Capability, Flag, Status
from protocols.cb.controller import BadChecksum, ControllerSession, DuplicateAnswered, RequestReceived, RequestRejected
from protocols.cb.frames import FramingBroken
from protocols.cb.messages import (
    ArmingDone,
    Bye,
    ErrorText,
    Farewell,
    GetError,
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
    Refused,
    Reply,
    Report,
    Request,
    SetArmed,
    Stop,
    Stopped,
    Welcome,
)

STANDING = Pose(
    (515.0, -20.5, 712.25), (0.5, 0.5, -0.5, 0.5), (0, -1, 0, 1), (9e9,) * 6, 1234, Flag.MOTORS_ON | Flag.IN_POSITION
)
BASE_T_FLANGE = transform_from_quaternion(STANDING.position_mm, STANDING.quaternion_wxyz)
JOINTS = Joints((10.0, -20.0, 30.0, 0.0, 90.0, -180.0), (9e9,) * 6)
Mangle = Callable[[Request, bytes], Iterable[bytes]]


@dataclass
class FakeArm:
    """What the controller knows. `polls_per_move`: a move ends at this STATUS; None: never by itself.

    `advances`: whether a move comes nearer to its goal from one STATUS to the next.
    """

    session: int = 7
    pose: Pose = STANDING
    polls_per_move: int | None = 2
    advances: bool = True
    ends_with: Status = Status.OK
    refuses: dict[type, Status] = field(default_factory=dict)
    armed: bool = False
    heard: list[Request] = field(default_factory=list)
    moves: list[Move] = field(default_factory=list)
    running_seq: int = 0
    finished: tuple[int, Status] = (0, Status.OK)
    polls: int = 0
    error: ErrorText | None = None

    def answer(self, seq: int, request: Request) -> Reply:
        """Do it, once."""
        self.heard.append(request)
        if type(request) in self.refuses:
            return Refused(self.refuses[type(request)])
        match request:
            case Hello():
                self.armed = False
                self._end(Status.ABORTED)
                can = Capability(7) | (Capability.REPORTS_ERRORS if self.error else Capability(0))
                return Welcome(1, can, self.session, 1, 1024, 6)
            case Ping():
                return Pong()
            case GetPose():
                return self.pose
            case GetJoints():
                return JOINTS
            case SetArmed(session=session, armed=armed):
                if session != self.session:
                    return Refused(Status.BAD_FIELD)
                self.armed = armed
                return ArmingDone()
            case Move():
                return self._begin(seq, request)
            case Stop():
                self._end(Status.ABORTED)
                return Stopped()
            case GetStatus():
                return self._report()
            case GetError():
                assert self.error is not None, "asked of a controller that does not give it"
                return self.error
            case Bye():
                self.armed = False
                return Farewell()

    def count(self, kind: type) -> int:
        """How many requests of this kind were done."""
        return sum(isinstance(request, kind) for request in self.heard)

    def _begin(self, seq: int, move: Move) -> Reply:
        if not self.armed:
            return Refused(Status.NOT_ARMED)
        if self.running_seq:
            return Refused(Status.BUSY)
        self.moves.append(move)
        self.running_seq, self.polls = seq, 0
        return MoveAccepted()

    def _end(self, status: Status) -> None:
        if self.running_seq:
            self.finished, self.running_seq = (self.running_seq, status), 0

    def _report(self) -> Report:
        self.polls += 1
        if self.polls_per_move is not None and self.polls >= self.polls_per_move:
            self._end(self.ends_with)
        moving = bool(self.running_seq)
        flags = Flag.MOTORS_ON | Flag.AUTO | (Flag.MOVING if moving else Flag.IN_POSITION)
        flags |= Flag.ARMED if self.armed else Flag(0)
        done = min(self.polls, 999) if self.advances else 500
        return Report(flags, *self.finished, done if moving else 1000, 4321)


class FakeController:
    """The arm behind any way of carrying bytes. `mangle` turns each outgoing reply into the pieces that are sent."""

    def __init__(self, arm: FakeArm | None = None, *, resynchronise: bool = False) -> None:
        self.arm = arm or FakeArm()
        self.mangle: Mangle = lambda request, reply: [reply]
        self.duplicates = 0
        self.connections = 0
        self.resynchronise = resynchronise
        self.greeting = b""

    def new_session(self) -> ControllerSession:
        self.connections += 1
        return ControllerSession(resynchronise=self.resynchronise)

    def pieces(self, session: ControllerSession, data: bytes) -> list[bytes]:
        """What to send for these bytes; b"" at the end means: close."""
        pieces: list[bytes] = []
        for event in session.receive_data(data):
            match event:
                case RequestReceived(seq=seq, message=message):
                    pieces += self.mangle(message, session.reply(seq, self.arm.answer(seq, message)))
                case DuplicateAnswered(answer=answer):
                    self.duplicates += 1
                    pieces.append(answer)
                case RequestRejected(answer=answer) | BadChecksum(answer=answer):
                    pieces.append(answer)
                case FramingBroken():
                    pieces.append(b"")
                case _:
                    pass
        return pieces


class TcpCell:
    """The controller on a TCP port of the system's choice."""

    def __init__(self, controller: FakeController) -> None:
        self.controller = controller
        self._writers: set[asyncio.StreamWriter] = set()
        self._server: asyncio.Server | None = None
        self.port = 0

    async def __aenter__(self) -> "TcpCell":
        await self.listen()
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.go_away()

    async def listen(self) -> None:
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", self.port)
        self.port = self._server.sockets[0].getsockname()[1]

    async def go_away(self) -> None:
        """No listener, and every connection closed."""
        if self._server is not None:
            self._server.close()
            self.cut()
            await self._server.wait_closed()
            self._server = None

    def cut(self) -> None:
        """Reset every connection."""
        for writer in list(self._writers):
            writer.transport.abort()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._writers.add(writer)
        session = self.controller.new_session()
        writer.write(self.controller.greeting)
        with contextlib.suppress(OSError):
            while data := await reader.read(4096):
                for piece in self.controller.pieces(session, data):
                    if not piece:
                        writer.close()
                        break
                    writer.write(piece)
                    await writer.drain()
        writer.close()
        self._writers.discard(writer)


class PtyCell:
    """The controller at one end of a pseudo terminal; `path` is the other end."""

    def __init__(self, controller: FakeController) -> None:
        self.controller = controller
        self.controller.resynchronise = True

    async def __aenter__(self) -> "PtyCell":
        self._master, self._slave = os.openpty()
        tty.setraw(self._master)
        tty.setraw(self._slave)
        self.path = os.ttyname(self._slave)
        self.session = self.controller.new_session()
        asyncio.get_running_loop().add_reader(self._master, self._read)
        return self

    async def __aexit__(self, *_: object) -> None:
        asyncio.get_running_loop().remove_reader(self._master)
        os.close(self._master)
        os.close(self._slave)

    def restart(self) -> None:
        """The controller forgets everything; the line has no connection that could break."""
        self.controller.arm.session += 1
        self.session = self.controller.new_session()

    def say(self, data: bytes) -> None:
        os.write(self._master, data)

    def _read(self) -> None:
        for piece in self.controller.pieces(self.session, os.read(self._master, 4096)):
            self.say(piece)
