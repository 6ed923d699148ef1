"""Signals: reading, switching, waiting, and alias names for signals that a program names by a string."""

from types import MappingProxyType
from typing import Any

from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.instructions.conditions import wait_for
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.signals import SIGNAL_TYPES, Signal, number_of, signal_of
from mock_robot.rapid.tasks import ProgramTask
from mock_robot.rapid.types import STRING, Type


def alias_io(task: ProgramTask, source: tuple[Type, Any], alias: tuple[Type, Slot]) -> None:
    """Errors of 3HAC050917: a signal that the controller does not have, or one of another type."""
    kind, value = source
    signal = task.services.signals.get(value) if kind == STRING else value
    if not isinstance(signal, Signal):
        raise RapidError("ERR_ALIASIO_DEF", f"no signal is named {value}")
    if SIGNAL_TYPES[signal.kind] != alias[0]:
        raise RapidError("ERR_ALIASIO_TYPE", f"{signal.name} is {signal.kind}, the alias {alias[0].name}")
    alias[1].value = signal


def read(task: ProgramTask, signal: Any) -> float:
    return number_of(signal)


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


DOES = MappingProxyType({"AliasIO": alias_io, "DInput": read, "DOutput": read, "SetDO": set_do, "WaitDO": wait_signal})
