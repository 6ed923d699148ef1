"""Interrupts on entries of the event log (IError), what a trap learns of them, and booked error numbers."""

from types import MappingProxyType
from typing import Any

from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.tasks import ProgramTask
from mock_robot.rapid.values import MAX_STRING_LENGTH

UNBOOKED = -1.0
FIRST_BOOKED = 2000.0
"""The mock's own first number of booked errors."""


def i_error(task: ProgramTask, domain: float, number: float | None, kind: float, interrupt: Slot) -> None:
    task.services.interrupts.watch_errors(interrupt.value, int(domain), int(kind), number)


def get_trap_data(task: ProgramTask, event: Slot) -> None:
    if task.event is None:
        raise RapidError("ERR_ARGVALERR", "GetTrapData outside of a trap that IError calls")
    event.value = task.event


def read_err_data(
    task: ProgramTask, event: Slot, domain: Slot, number: Slot, kind: Slot, title: Slot | None, *texts: Slot | None
) -> None:
    found: Any = event.value
    domain.value, number.value, kind.value = float(found.domain), float(found.number), float(found.type)
    for slot, text in zip((title, *texts), (found.title, found.cause, "", "", "", ""), strict=True):
        if slot is not None:
            slot.value = text[:MAX_STRING_LENGTH]


def book_err_no(task: ProgramTask, number: Slot) -> None:
    """The variable must hold -1."""
    if number.value != UNBOOKED:
        raise RapidError("ERR_ARGVALERR", "BookErrNo wants a variable that holds -1")
    number.value = FIRST_BOOKED + task.booked
    task.booked += 1


DOES = MappingProxyType(
    {"IError": i_error, "GetTrapData": get_trap_data, "ReadErrData": read_err_data, "BookErrNo": book_err_no}
)
