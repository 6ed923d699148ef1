"""TriggInt, TriggIO and TriggEquip: what happens on the way of TriggJ, TriggL and TriggC."""

from types import MappingProxyType
from typing import Any

from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.signals import signal_of
from mock_robot.rapid.tasks import ProgramTask


def trigg_int(
    task: ProgramTask, data: Slot, distance: float, start: bool | None, timed: bool | None, interrupt: Slot
) -> None:
    number = interrupt.value
    data.value.set(distance, bool(start), bool(timed), lambda task: task.services.interrupts.trigger(number))


def trigg_io(
    task: ProgramTask,
    data: Slot,
    distance: float,
    start: bool | None,
    timed: bool | None,
    digital: Slot | None,
    group: Slot | None,
    analogue: Slot | None,
    value: float,
    delay: float | None,
) -> None:
    """The delay of \\DODelay is not made."""
    _switch(data, distance, bool(start), bool(timed), digital or group or analogue, value)


def trigg_equip(
    task: ProgramTask,
    data: Slot,
    distance: float,
    start: bool | None,
    lag: float,
    digital: Slot | None,
    group: Slot | None,
    analogue: Slot | None,
    value: float,
) -> None:
    """The equipment's lag is not compensated."""
    _switch(data, distance, bool(start), False, digital or group or analogue, value)


def _switch(data: Slot, distance: float, start: bool, timed: bool, output: Slot | None, value: float) -> None:
    if output is None:
        raise RapidError("ERR_ARGVALERR", "give \\DOp, \\GOp or \\AOp")
    signal = signal_of(output.value)

    def set_signal(task: Any) -> None:
        signal.value = bool(value) if signal.kind == "DO" else value

    data.value.set(distance, start, timed, set_signal)


DOES = MappingProxyType({"TriggInt": trigg_int, "TriggIO": trigg_io, "TriggEquip": trigg_equip})
