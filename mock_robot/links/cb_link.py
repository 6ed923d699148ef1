"""One client's link: connects the protocol session, the controller and the faults, without I/O."""

from mock_robot.cabinet.wire_steps import Close, Send, WireStep
from mock_robot.faults.board import FaultBoard
from mock_robot.links.cb_program import Controller
from protocols.cb.codes import Command, Status
from protocols.cb.controller import ControllerSession
from protocols.cb.events import (
    BadChecksum,
    ControllerEvent,
    DuplicateAnswered,
    DuplicatePending,
    RequestReceived,
    RequestRejected,
)
from protocols.cb.frames import FramingBroken, GarbageSkipped
from protocols.cb.layouts import COMMAND_OF
from protocols.cb.messages import Bye
from protocols.cb.session_state import SessionState

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
        """Feed received bytes."""
        steps = self._handle_restart()
        data = self._faults.alter_incoming(data)
        if data:
            self._last_byte_s = now_s
            steps += self._act_on(self._session.receive_data(data), now_s)
        return steps

    def tick(self, now_s: float) -> list[WireStep]:
        """Advance to `now_s`."""
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


class RefusedLink:
    """Link of a surplus client: its first request is answered BUSY, then the connection closes."""

    def __init__(self) -> None:
        self._session = ControllerSession(resynchronise=False, refuse_with=Status.BUSY)

    def receive_data(self, data: bytes) -> list[WireStep]:
        """Feed received bytes."""
        events = self._session.receive_data(data)
        answers = [Send(event.answer) for event in events if isinstance(event, RequestRejected)]
        return [*answers[:1], Close()] if events else []
