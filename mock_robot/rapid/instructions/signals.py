"""Signals: reading, switching, pulses, waiting, and alias names for signals that a program names by a string."""

import threading
from collections.abc import Callable
from types import MappingProxyType
from typing import Any

from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.instructions.conditions import wait_for
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.signals import SIGNAL_TYPES, Signal, number_of, signal_of
from mock_robot.rapid.tasks import ProgramTask
from mock_robot.rapid.types import STRING, Type
from mock_robot.rapid.values import integer, single

PULSE_S = 0.2
"""Length of a pulse without \\PLength."""
MAX_GROUP = 2**23 - 1
"""A num holds a group of 23 signals."""


def alias_io(task: ProgramTask, source: tuple[Type, Any], alias: tuple[Type, Slot]) -> None:
    """Errors of 3HAC050917: a signal that the controller does not have, or one of another type."""
    kind, value = source
    signal = task.services.signals.get(value) if kind == STRING else value
    if not isinstance(signal, Signal):
        raise RapidError("ERR_ALIASIO_DEF", f"no signal is named {value}")
    if SIGNAL_TYPES[signal.kind] != alias[0]:
        raise RapidError("ERR_ALIASIO_TYPE", f"{signal.name} is {signal.kind}, the alias {alias[0].name}")
    alias[1].value = signal


def alias_io_reset(task: ProgramTask, alias: tuple[Type, Slot]) -> None:
    alias[1].value = alias[0].initial()


def read(task: ProgramTask, signal: Any) -> float:
    return number_of(signal)


def _set(signal: Any, value: float) -> None:
    known = signal_of(signal)
    if known.source is not None:
        raise RapidError("ERR_ARGVALERR", f"{known.name} mirrors the controller: programs only read it")
    known.value = bool(value) if known.kind == "DO" else single(value)


def _later(seconds: float, do: Callable[[], None]) -> None:
    timer = threading.Timer(seconds, do)
    timer.daemon = True
    timer.start()


def set_do(task: ProgramTask, delay: float | None, at_once: bool | None, signal: Slot, value: float) -> None:
    """\\Sync waits for the signal's real state, which the mock's has at once."""
    if delay is None:
        _set(signal.value, value)
    else:
        _later(delay, lambda: _set(signal.value, value))


def set_output(task: ProgramTask, signal: Slot) -> None:
    _set(signal.value, 1.0)


def reset_output(task: ProgramTask, signal: Slot) -> None:
    _set(signal.value, 0.0)


def invert_output(task: ProgramTask, signal: Slot) -> None:
    _set(signal.value, 1.0 - number_of(signal.value))


def pulse(task: ProgramTask, high: bool | None, length_s: float | None, signal: Slot) -> None:
    """The inverse for the time, or with \\High one; then the state before, with \\High zero. The program goes on."""
    before = number_of(signal.value)
    _set(signal.value, 1.0 if high else 1.0 - before)
    _later(PULSE_S if length_s is None else length_s, lambda: _set(signal.value, 0.0 if high else before))


def set_analogue(task: ProgramTask, signal: Slot, value: float) -> None:
    _set(signal.value, value)


def set_group(task: ProgramTask, delay: float | None, signal: Slot, value: float) -> None:
    if not 0 <= integer(value) <= MAX_GROUP:
        raise RapidError("ERR_GO_LIM", f"{value:g} is no value of a group")
    set_do(task, delay, None, signal, value)


def wait_signal(
    task: ProgramTask, signal: Any, value: float, most_s: float | None, flag: Slot | None, *shown: Any
) -> None:
    """What the pendant shows meanwhile (\\Visualize) is left out."""
    wait_for(task, lambda: number_of(signal) == value, most_s, flag)


def wait_analogue(task: ProgramTask, signal: Any, *arguments: Any) -> None:
    """Until it is below (\\LT), above (\\GT) or at the value: as a group signal without \\NOTEQ."""
    wait_group(task, signal, None, *arguments)


def wait_group(
    task: ProgramTask,
    signal: Any,
    other: bool | None,
    below: bool | None,
    above: bool | None,
    value: float,
    most_s: float | None,
    flag: Slot | None,
    at_timeout: Slot | None,
    *shown: Any,
) -> None:
    """Until it differs from the value (\\NOTEQ), is below (\\LT), above (\\GT) or at it."""

    def holds() -> bool:
        now = number_of(signal)
        return now != value if other else now < value if below else now > value if above else now == value

    try:
        wait_for(task, holds, most_s, flag)
    finally:
        if at_timeout is not None and not holds():
            at_timeout.value = number_of(signal)


def on_digital(task: ProgramTask, once: bool | None, signal: Any, value: float, interrupt: Slot) -> None:
    """1: on rising, 0: on falling, 2 (edge): on both."""
    of_interest = None if value == 2.0 else value
    task.services.interrupts.watch_signal(signal_of(signal), interrupt.value, of_interest, bool(once))


def on_output(task: ProgramTask, once: bool | None, signal: Slot, value: float, interrupt: Slot) -> None:
    on_digital(task, once, signal.value, value, interrupt)


def on_group(task: ProgramTask, once: bool | None, signal: Any, interrupt: Slot) -> None:
    task.services.interrupts.watch_signal(signal_of(signal), interrupt.value, None, bool(once))


DOES = MappingProxyType(
    {
        "AliasIO": alias_io,
        "AliasIOReset": alias_io_reset,
        "DInput": read,
        "DOutput": read,
        "AInput": read,
        "AOutput": read,
        "GInput": read,
        "GOutput": read,
        "GInputDnum": read,
        "GOutputDnum": read,
        "TestDI": lambda task, signal: number_of(signal) == 1.0,
        "SetDO": set_do,
        "Set": set_output,
        "Reset": reset_output,
        "InvertDO": invert_output,
        "PulseDO": pulse,
        "SetAO": set_analogue,
        "SetGO": set_group,
        "WaitDI": wait_signal,
        "WaitDO": wait_signal,
        "WaitGI": wait_group,
        "WaitGO": wait_group,
        "WaitAI": wait_analogue,
        "WaitAO": wait_analogue,
        "ISignalDI": on_digital,
        "ISignalDO": on_output,
        "ISignalGI": on_group,
        "ISignalGO": lambda task, once, signal, interrupt: on_group(task, once, signal.value, interrupt),
    }
)
