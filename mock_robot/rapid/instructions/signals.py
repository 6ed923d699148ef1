"""Signals: reading, switching, waiting, and alias names for signals that a program names by a string.

Also what a program finds of the cabinet (mode, override, addresses), and serial lines: an iodev on the pty behind a
port's name.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from mock_robot.cabinet.panel import Mode
from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.instructions.conditions import wait_for
from mock_robot.rapid.instructions.sockets import DEFAULT_WAIT_S, MAX_WAIT_S, close, content_of
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.signals import Signal, number_of, signal_of
from mock_robot.rapid.tasks import ProgramTask
from mock_robot.rapid.types import SIGNAL_TYPES, STRING, Type

MODES: Mapping[Mode, float] = MappingProxyType({Mode.AUTO: 1.0, Mode.MANR: 2.0, Mode.MANF: 3.0})
"""OP_AUTO, OP_MAN_PROG and OP_MAN_TEST of system.rapid."""

SYSTEM = ("mock-0001", "6.16.0202", "6.16.02.02", "mock", "mock", "en", "mock")
"""Serial number, version, its name, type of robot, controller's id, language and name of the system."""


def system_info(task: ProgramTask, *switches: bool | None) -> str:
    """By its switch; the LAN address of a virtual controller is VC."""
    devices = task.services.devices
    known = (*SYSTEM[:5], "VC" if devices.virtual else str(devices.host), *SYSTEM[5:])
    asked = [text for text, switch in zip(known, switches, strict=True) if switch]
    if len(asked) != 1:
        raise RapidError("ERR_ARGVALERR", "GetSysInfo needs one of its switches")
    return asked[0]


def open_(task: ProgramTask, port: str, slot: Slot, binary: bool | None) -> None:
    """A channel for both directions needs \\Bin."""
    if not binary:
        raise RapidError("ERR_ARGVALERR", "the mock opens a channel only with \\Bin, for both directions")
    line = task.services.devices.lines.get(port.casefold())
    if line is None:
        raise RapidError("ERR_FILEOPEN", f"no channel is named {port}")
    slot.value.open(line)
    task.services.devices.add(slot.value)


def clear_buffer(task: ProgramTask, slot: Slot) -> None:
    """Drop what a line has received."""
    slot.value.line.look(task.services.wire)
    slot.value.line.arrived.clear()


def read_bin(task: ProgramTask, slot: Slot, time: float | None) -> float:
    """Read one byte."""
    line, seconds = slot.value.line, DEFAULT_WAIT_S if time is None else time
    task.services.devices.reachable.set()
    ends_s = None if seconds >= MAX_WAIT_S else task.now_s() + seconds
    while not line.arrived and not line.look(task.services.wire):
        left_s = None if ends_s is None else max(0.0, ends_s - task.now_s())
        if not task.wait(left_s, line.fileno):
            raise RapidError("ERR_DEV_MAXTIME", "no byte came")
    return float(line.arrived.pop(0))


def alias_io(task: ProgramTask, source: tuple[Type, Any], alias: tuple[Type, Slot]) -> None:
    """Errors of 3HAC050917: a signal that the controller does not have, or one of another type."""
    kind, value = source
    signal = task.services.signals.get(value) if kind == STRING else value
    if not isinstance(signal, Signal):
        raise RapidError("ERR_ALIASIO_DEF", f"no signal is named {value}")
    if SIGNAL_TYPES[signal.kind] != alias[0]:
        raise RapidError("ERR_ALIASIO_TYPE", f"{signal.name} is {signal.kind}, the alias {alias[0].name}")
    alias[1].value = signal


def set_do(task: ProgramTask, signal: Slot, value: float) -> None:
    known = signal_of(signal.value)
    if known.source is not None:
        raise RapidError("ERR_ARGVALERR", f"{known.name} mirrors the controller: programs only read it")
    known.value = bool(value)


def wait_signal(
    task: ProgramTask, signal: Any, value: float, most_s: float | None, flag: Slot | None, *shown: Any
) -> None:
    """What the pendant shows meanwhile (\\Visualize) is left out."""
    wait_for(task, lambda: number_of(signal) == value, most_s, flag)


DOES = MappingProxyType(
    {
        "AliasIO": alias_io,
        "DInput": lambda task, signal: number_of(signal),
        "DOutput": lambda task, signal: number_of(signal),
        "SetDO": set_do,
        "WaitDO": wait_signal,
        "OpMode": lambda task: MODES[task.services.panel.mode],
        "CSpeedOverride": lambda task, current_task: round(100 * float(task.services.panel.speed_override), 2),
        "GetSysInfo": system_info,
        "RobOS": lambda task: not task.services.devices.virtual,
        "Open": open_,
        "Close": close,
        "ClearIOBuff": clear_buffer,
        "ReadBin": read_bin,
        "WriteRawBytes": lambda task, slot, raw, count: slot.value.send(content_of(raw, count), task.services.wire),
    }
)
