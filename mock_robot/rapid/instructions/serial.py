"""Serial lines: an iodev on the pty behind a port's name."""

from types import MappingProxyType
from typing import Any

from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.instructions.sockets import DEFAULT_WAIT_S, MAX_WAIT_S
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.tasks import ProgramTask
from mock_robot.rapid.values import integer


def open_(task: ProgramTask, port: str, slot: Slot, binary: bool | None) -> None:
    """A channel for both directions needs \\Bin."""
    if not binary:
        raise RapidError("ERR_ARGVALERR", "the mock opens a channel only with \\Bin, for both directions")
    line = task.services.devices.lines.get(port.casefold())
    if line is None:
        raise RapidError("ERR_FILEOPEN", f"no channel is named {port}")
    slot.value.open(line)
    task.services.devices.add(slot.value)


def close(task: ProgramTask, slot: Slot) -> None:
    slot.value.close()
    task.services.devices.drop(slot.value)


def clear_buffer(task: ProgramTask, slot: Slot) -> None:
    """Drop what a line has received."""
    slot.value.line.look(task.services.wire)
    slot.value.line.arrived.clear()


def read_bin(task: ProgramTask, slot: Slot, time: float | None) -> float:
    """Read one byte."""
    line, seconds = slot.value.line, DEFAULT_WAIT_S if time is None else time
    task.services.devices.note_listening()
    ends_s = None if seconds >= MAX_WAIT_S else task.now_s() + seconds
    while not line.arrived and not line.look(task.services.wire):
        left_s = None if ends_s is None else max(0.0, ends_s - task.now_s())
        if not task.wait(left_s, line.fileno):
            raise RapidError("ERR_DEV_MAXTIME", "no byte came")
    return float(line.arrived.pop(0))


def write_raw_bytes(task: ProgramTask, slot: Slot, raw: Any, count: float | None) -> None:
    data = raw.value.valid() if count is None else raw.value.read(1, integer(count))
    slot.value.send(data, task.services.wire)


DOES = MappingProxyType(
    {"Open": open_, "Close": close, "ClearIOBuff": clear_buffer, "ReadBin": read_bin, "WriteRawBytes": write_raw_bytes}
)
