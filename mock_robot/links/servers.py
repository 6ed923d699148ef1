"""The CB link of the Python program: one client's link without I/O, on a TCP server for one client and on a pty."""

import asyncio
import os
import socket
import struct
from collections.abc import Callable, Iterable
from contextlib import suppress

from mock_robot.cabinet.wire_steps import Close, Pause, Reset, Send, WireStep
from mock_robot.devices.tcp_server import TcpServer
from mock_robot.faults.board import FaultBoard
from mock_robot.links.cb_program import HEARTBEAT_S, Controller
from protocols.cb.codes import Command, SessionState, Status
from protocols.cb.controller import (
    BadChecksum,
    ControllerEvent,
    ControllerSession,
    DuplicateAnswered,
    DuplicatePending,
    RequestReceived,
    RequestRejected,
)
from protocols.cb.frames import FramingBroken, GarbageSkipped
from protocols.cb.layouts import COMMAND_OF
from protocols.cb.messages import Bye

HALF_FRAME_S = 0.5
"""A frame interrupted for longer than this is discarded."""
IDLE_S = 10.0
"""A TCP client silent for longer than this may be replaced by another."""


class ControllerLink:
    """Bytes in, wire steps out; call `tick` when `next_event_s` says so. `serial`: there is no connection to close."""

    def __init__(self, controller: Controller, faults: FaultBoard, *, serial: bool, now_s: float) -> None:
        self._controller = controller
        self._faults = faults
        self._serial = serial
        self._session = ControllerSession(resynchronise=serial)
        self._session_number = controller.session
        self._last_byte_s = self.heard_at_s = now_s

    def receive_data(self, data: bytes, now_s: float) -> list[WireStep]:
        steps = self._handle_restart()
        data = self._faults.alter_incoming(data)
        if data:
            self._last_byte_s = now_s
            steps += self._act_on(self._session.receive_data(data), now_s)
        return steps

    def tick(self, now_s: float) -> list[WireStep]:
        self._faults.wake(self._controller, now_s)
        steps = self._handle_restart()
        for answer in self._controller.tick(now_s):
            if self._session.state is SessionState.GREETED:
                steps += self._faults.outgoing(None, self._session.announce(answer))
        if self._session.half_frame_bytes and now_s - self._last_byte_s >= HALF_FRAME_S:
            steps += self._act_on(self._session.abandon_half_frame(), now_s)
        if not self._serial and now_s - self.heard_at_s >= IDLE_S:
            steps.append(Close())
        return steps

    def next_event_s(self, now_s: float) -> float | None:
        """Time at which `tick` is due; None when only received bytes can change anything."""
        times = [self._controller.next_event_s(now_s)]
        if self._session.half_frame_bytes:
            times.append(self._last_byte_s + HALF_FRAME_S)
        if not self._serial:
            times.append(self.heard_at_s + IDLE_S)
        return min((time for time in times if time is not None), default=None)

    def _handle_restart(self) -> list[WireStep]:
        """React to a restart of the controller: its connections and sessions are gone."""
        if self._session_number == self._controller.session:
            return []
        self._session_number = self._controller.session
        self._session = ControllerSession(resynchronise=self._serial)
        return [] if self._serial else [Close()]

    def _act_on(self, events: list[ControllerEvent], now_s: float) -> list[WireStep]:
        steps: list[WireStep] = []
        for event in events:
            steps += self._act(event, now_s)
            if Close() in steps:
                break
        return steps

    def _act(self, event: ControllerEvent, now_s: float) -> list[WireStep]:
        match event:
            case RequestReceived():
                return self._request(event, now_s)
            case DuplicateAnswered() | RequestRejected():
                self._alive(now_s)
                return [*self._faults.outgoing(None, event.answer)]
            case BadChecksum():
                return [Send(event.answer)]
            case DuplicatePending():  # it came in one piece with its request, which has been answered since
                self._alive(now_s)
                stored = self._session.reply_to(event.seq)
                return [] if stored is None else [*self._faults.outgoing(None, stored)]
            case GarbageSkipped():
                return []
            case FramingBroken():
                return [Close()]

    def _request(self, event: RequestReceived, now_s: float) -> list[WireStep]:
        self._alive(now_s)
        command: Command = COMMAND_OF[type(event.message)]
        reply = self._controller.answer(event.seq, event.message, now_s)
        reply = self._faults.alter_reply(command, reply)
        answer = self._session.reply(event.seq, reply)
        steps = [*self._faults.outgoing(command, answer)]
        self._faults.wake(self._controller, now_s)
        if isinstance(event.message, Bye) and not self._serial:
            steps.append(Close())
        return steps

    def _alive(self, now_s: float) -> None:
        self.heard_at_s = now_s
        self._controller.note_sign_of_life(now_s)


Clock = Callable[[], float]
REFUSAL_S = 1.0
"""How long a surplus client's request is awaited."""
FAREWELL_S = 0.05
"""Grace period, so that a client that reconnects at once does not find its own place taken."""
CHUNK = 4096


class TcpLinkServer(TcpServer):
    """The robot's server socket. A second client is answered BUSY and closed, unless the first has fallen silent."""

    def __init__(self, controller: Controller, faults: FaultBoard, clock: Clock) -> None:
        super().__init__()
        self._controller, self._faults, self._clock = controller, faults, clock
        self._link: ControllerLink | None = None
        self._talking: asyncio.Task[None] | None = None
        self._nudge = asyncio.Event()

    def nudge(self) -> None:
        """React now to a change made from outside (a fault, a switch)."""
        self._nudge.set()

    async def _converse(
        self, task: asyncio.Task[None], reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        if self._link is not None:
            await asyncio.sleep(FAREWELL_S)
        if self._link is not None and self._talking is not None:
            if self._clock() - self._link.heard_at_s < HEARTBEAT_S:
                await _turn_away(reader, writer)
                return
            self._talking.cancel()
            await asyncio.wait([self._talking])
        link = self._link = ControllerLink(self._controller, self._faults, serial=False, now_s=self._clock())
        self._talking = task
        try:
            await self._talk(link, reader, writer)
        finally:
            if self._link is link:
                self._link = self._talking = None
                self._controller.disconnect(self._clock())

    async def _talk(self, link: ControllerLink, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while True:
            data = await self._read(link, reader)
            if data == b"":
                return
            now_s = self._clock()
            steps = link.tick(now_s) if data is None else link.receive_data(data, now_s)
            if not await _perform(steps, writer):
                return

    async def _read(self, link: ControllerLink, reader: asyncio.StreamReader) -> bytes | None:
        """Received bytes; b"" after a disconnect; None when a tick is due."""
        due_s = link.next_event_s(self._clock())
        wait_s = None if due_s is None else max(due_s - self._clock(), 0.0)
        reading = asyncio.ensure_future(reader.read(CHUNK))
        nudged = asyncio.ensure_future(self._nudge.wait())
        try:
            await asyncio.wait({reading, nudged}, timeout=wait_s, return_when=asyncio.FIRST_COMPLETED)
            self._nudge.clear()
            return reading.result() if reading.done() else None
        finally:
            for waiting in (reading, nudged):
                waiting.cancel()


async def _turn_away(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Answer a surplus client's first request BUSY; then the connection closes."""
    session = ControllerSession(resynchronise=False, refuse_with=Status.BUSY)
    with suppress(TimeoutError):
        async with asyncio.timeout(REFUSAL_S):
            while data := await reader.read(CHUNK):
                if events := session.receive_data(data):
                    answers = [Send(event.answer) for event in events if isinstance(event, RequestRejected)]
                    await _perform(answers[:1], writer)
                    return


async def _perform(steps: Iterable[WireStep], writer: asyncio.StreamWriter) -> bool:
    """Carry the steps out; returns False when the connection is to end."""
    for step in steps:
        match step:
            case Send(data):
                writer.write(data)
                await writer.drain()
            case Pause(seconds):
                await asyncio.sleep(seconds)
            case Close():
                return False
            case Reset():
                linger_not = struct.pack("ii", 1, 0)
                writer.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger_not)
                writer.transport.abort()
                return False
    return True


def open_pty() -> tuple[tuple[int, int], str]:
    """Both ends of a raw pty, the first of which never blocks, and the path of the second."""
    import tty  # POSIX only, as the line is

    ends = os.openpty()
    for end in ends:
        tty.setraw(end)
    os.set_blocking(ends[0], False)
    return ends, os.ttyname(ends[1])


class SerialLinkServer:
    """The robot's end of a serial line: a pty, opened by the client by its path."""

    def __init__(self, controller: Controller, faults: FaultBoard, clock: Clock) -> None:
        self._controller, self._faults, self._clock = controller, faults, clock
        self._ours = self._theirs = -1
        self._arrived: asyncio.Queue[bytes] = asyncio.Queue()
        self._talking: asyncio.Task[None] | None = None

    async def start(self) -> str:
        """Open the pty; returns the path for the client."""
        (self._ours, self._theirs), path = open_pty()
        asyncio.get_running_loop().add_reader(self._ours, self._readable)
        self._talking = asyncio.create_task(self._talk())
        return path

    def nudge(self) -> None:
        if self._talking is not None:
            self._arrived.put_nowait(b"")

    async def close(self) -> None:
        if self._talking is None:
            return
        asyncio.get_running_loop().remove_reader(self._ours)
        self._talking.cancel()
        await asyncio.gather(self._talking, return_exceptions=True)
        os.close(self._ours)
        os.close(self._theirs)

    def _readable(self) -> None:
        with suppress(BlockingIOError, OSError):
            self._arrived.put_nowait(os.read(self._ours, CHUNK))

    async def _talk(self) -> None:
        link = ControllerLink(self._controller, self._faults, serial=True, now_s=self._clock())
        while True:
            data = await self._next(link)
            now_s = self._clock()
            for step in link.receive_data(data, now_s) if data else link.tick(now_s):
                match step:
                    case Send(sent):
                        with suppress(BlockingIOError):  # nobody reads: those bytes are lost, as on a real line
                            os.write(self._ours, sent)
                    case Pause(seconds):
                        await asyncio.sleep(seconds)
                    case Close() | Reset():
                        pass

    async def _next(self, link: ControllerLink) -> bytes:
        """Received bytes, or b"" when a tick is due."""
        due_s = link.next_event_s(self._clock())
        wait_s = None if due_s is None else max(due_s - self._clock(), 0.0)
        try:
            return await asyncio.wait_for(self._arrived.get(), wait_s)
        except TimeoutError:
            return b""
