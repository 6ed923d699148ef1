"""Digital signals: reading, switching, and alias names for signals that a program names by a string."""

from types import MappingProxyType
from typing import Any

from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.signals import DigitalSignal
from mock_robot.rapid.tasks import ProgramTask
from mock_robot.rapid.types import STRING, Type


def alias_io(task: ProgramTask, source: tuple[Type, Any], alias: tuple[Type, Slot]) -> None:
    """Errors of 3HAC050917: a signal that the controller does not have, or one of the other direction."""
    kind, value = source
    signal = task.services.signals.get(value) if kind == STRING else value
    if not isinstance(signal, DigitalSignal):
        raise RapidError("ERR_ALIASIO_DEF", f"no signal is named {value}")
    wanted = {"signaldo": "DO", "signaldi": "DI"}.get(alias[0].name)
    if signal.kind != wanted:
        raise RapidError("ERR_ALIASIO_TYPE", f"{signal.name} is {signal.kind}, the alias {alias[0].name}")
    alias[1].value = signal


def _signal(value: Any) -> DigitalSignal:
    if not isinstance(value, DigitalSignal):
        raise RapidError("ERR_NO_ALIASIO_DEF", "the signal was declared, but AliasIO has not connected it")
    return value


def read(task: ProgramTask, signal: Any) -> float:
    return float(_signal(signal).read())


def set_do(task: ProgramTask, signal: Slot, value: float) -> None:
    known = _signal(signal.value)
    if known.source is not None:
        raise RapidError("ERR_ARGVALERR", f"{known.name} is a system output: programs only read it")
    known.value = bool(value)


DOES = MappingProxyType({"AliasIO": alias_io, "DInput": read, "DOutput": read, "SetDO": set_do})
