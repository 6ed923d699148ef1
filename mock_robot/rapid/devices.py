"""RAPID devices on real ones: socketdev on sockets, iodev on a pty; with the faults of their wires."""

import os
import queue
import socket
import struct
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace

from mock_robot.cabinet.wire_steps import Close, Pause, Reset, Send, WireStep
from mock_robot.faults.board import FaultBoard
from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.types import Atom
from protocols.cb.codes import REPLY_BIT, Command, Status
from protocols.cb.frames import Frame, FrameReader
from protocols.cb.layouts import ANSWERS, pack, unpack
from protocols.cb.messages import Refused


class FrameFaultBoard(FaultBoard):
    """A fault board for a program that sends bytes: whole frames are decoded, so that replies can be altered."""

    def outgoing_bytes(self, data: bytes) -> tuple[WireStep, ...]:
        """Wire steps sent instead of the program's bytes."""
        frame = _frame(data) if self.active else None
        if frame is None or frame.seq == 0:
            return self.outgoing(None, data)
        command = _command(frame)
        return self.outgoing(command, self._alter(command, frame, data))

    def _alter(self, command: Command | None, frame: Frame, data: bytes) -> bytes:
        if command is None or frame.status > Status.ACCEPTED:
            return data
        answer = unpack(ANSWERS[command], frame.payload)
        altered = self.alter_reply(command, answer)
        if altered is answer or isinstance(altered, Refused):
            return data
        return replace(frame, payload=pack(altered)).encode()


def _frame(data: bytes) -> Frame | None:
    """Decode the bytes as one frame; None when they are not one."""
    events = FrameReader(resynchronise=False).feed(data)
    return events[0] if len(events) == 1 and isinstance(events[0], Frame) else None


def _command(frame: Frame) -> Command | None:
    number = frame.command & ~REPLY_BIT
    return Command(number) if number in [*Command] else None


CHUNK = 4096


@dataclass
class Carrier:
    """Writes one connection's output in order, delayed where a fault says so."""

    write: Callable[[bytes], None]
    hang_up: Callable[[bool], None]
    _late: "queue.SimpleQueue[tuple[float, WireStep]] | None" = field(default=None, init=False)

    def carry(self, steps: tuple[WireStep, ...]) -> None:
        """Carry out steps. A pause delays the steps behind it, but neither the program nor what it sends next."""
        if self._late is None and all(isinstance(step, Send) for step in steps):
            for step in steps:
                self._do(step)
            return
        if self._late is None:
            self._late = queue.SimpleQueue()
            threading.Thread(target=self._carry_late, args=(self._late,), name="rapid wire", daemon=True).start()
        due_s = time.monotonic()
        for step in steps:
            if isinstance(step, Pause):
                due_s += step.seconds
            else:
                self._late.put((due_s, step))

    def end(self) -> None:
        if self._late is not None:
            self._late.put((0.0, Close()))

    def _carry_late(self, late: "queue.SimpleQueue[tuple[float, WireStep]]") -> None:
        while True:
            due_s, step = late.get()
            time.sleep(max(0.0, due_s - time.monotonic()))
            with suppress(OSError):
                self._do(step)
            if isinstance(step, Close | Reset):
                return

    def _do(self, step: WireStep) -> None:
        match step:
            case Send(data):
                self.write(data)
            case Close():
                self.hang_up(False)
            case Reset():
                self.hang_up(True)
            case Pause():
                pass


class SocketDevice:
    """A socketdev: not created, created, bound, listening, or connected."""

    def __init__(self) -> None:
        self.state = "closed"
        self.end: socket.socket | None = None
        self.arrived = bytearray()
        self.over = False
        self._carrier: Carrier | None = None

    def create(self) -> None:
        """Create the socket; raises if one is open."""
        self.require(self.end is None, "ERR_SOCK_IS_CONN", "the socket is in use: close it first")
        self._open(socket.socket(socket.AF_INET, socket.SOCK_STREAM), "created")
        assert self.end is not None
        self.end.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)

    def connect(self, end: socket.socket) -> None:
        """Adopt an accepted connection."""
        end.setblocking(False)
        end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._open(end, "connected")
        self._carrier = Carrier(self._write, self._hang_up)

    def _open(self, end: socket.socket, state: str) -> None:
        self.end, self.state, self.arrived, self.over, self._carrier = end, state, bytearray(), False, None

    def close(self) -> None:
        """Close; a no-op when closed."""
        carrier, self._carrier = self._carrier, None
        if carrier is not None:
            carrier.end()
        end, self.end, self.state = self.end, None, "closed"
        if end is not None:
            end.close()
        self.arrived.clear()

    def require_open(self) -> socket.socket:
        """The created socket; raises ERR_SOCK_CLOSED."""
        if self.end is None:
            raise RapidError("ERR_SOCK_CLOSED", "the socket is closed")
        return self.end

    def require_connected(self) -> socket.socket:
        """The connected socket; raises when there is no connection."""
        end = self.require_open()
        self.require(self.state == "connected", "ERR_SOCK_NOT_CONN", f"the socket is {self.state}, not connected")
        return end

    def look(self, board: FrameFaultBoard) -> int:
        """Read what has arrived; returns the buffered byte count. Raises ERR_SOCK_CLOSED at the end of the stream."""
        end = self.require_connected()
        try:
            while not self.over and (data := end.recv(CHUNK)):
                self.arrived += board.alter_incoming(data)
            self.over = True
        except BlockingIOError:
            pass
        except OSError:
            self.over = True
        if self.over and not self.arrived:
            raise RapidError("ERR_SOCK_CLOSED", "the peer closed the connection")
        return len(self.arrived)

    def take(self, count: int) -> bytes:
        taken = bytes(self.arrived[:count])
        del self.arrived[:count]
        return taken

    def send(self, data: bytes, board: FrameFaultBoard) -> None:
        self.require_connected()
        assert self._carrier is not None
        try:
            self._carrier.carry(board.outgoing_bytes(data))
        except OSError as error:
            raise RapidError("ERR_SOCK_CLOSED", f"the peer is gone: {error.strerror}") from None

    @staticmethod
    def require(holds: bool, error: str, detail: str) -> None:
        if not holds:
            raise RapidError(error, detail)

    def _write(self, data: bytes) -> None:
        if self.end is not None:
            self.end.sendall(data)

    def _hang_up(self, reset: bool) -> None:
        end = self.end
        if end is None or self.state != "connected":
            return
        self.over = True  # the program notices and closes; with a linger of 0 that is a reset
        with suppress(OSError):
            if reset:
                end.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            else:
                end.shutdown(socket.SHUT_RDWR)


@dataclass
class SerialLine:
    """The controller's end of a pty, behind a port's name."""

    fileno: int
    arrived: bytearray = field(default_factory=bytearray)

    def look(self, board: FrameFaultBoard) -> int:
        """Read what has arrived; returns the number of buffered bytes."""
        with suppress(BlockingIOError, OSError):
            while data := os.read(self.fileno, CHUNK):
                self.arrived += board.alter_incoming(data)
        return len(self.arrived)

    def write(self, data: bytes) -> None:
        """Write bytes; those nobody reads are lost, as on a real line."""
        with suppress(BlockingIOError):
            os.write(self.fileno, data)


class IoDevice:
    """An iodev: a serial line once opened."""

    def __init__(self) -> None:
        self._line: SerialLine | None = None
        self._carrier: Carrier | None = None

    def open(self, line: SerialLine) -> None:
        self._line, self._carrier = line, Carrier(line.write, lambda reset: None)

    def close(self) -> None:
        if self._carrier is not None:
            self._carrier.end()
        self._line = self._carrier = None

    @property
    def line(self) -> SerialLine:
        if self._line is None:
            raise RapidError("ERR_FILEACC", "the channel is not open")
        return self._line

    def send(self, data: bytes, board: FrameFaultBoard) -> None:
        assert self.line is not None
        assert self._carrier is not None
        self._carrier.carry(board.outgoing_bytes(data))


SOCKETDEV = Atom("socketdev", SocketDevice, device=True)
IODEV = Atom("iodev", IoDevice, device=True)
DEVICES = (SOCKETDEV, IODEV)
