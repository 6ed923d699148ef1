"""Applies the faults of replies and bytes between a RAPID program and its wire."""

from dataclasses import replace

from mock_robot.cabinet.wire_steps import WireStep
from mock_robot.faults.board import FaultBoard
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
