"""Dialogues at the pendant: nobody stands there, so each waits for its \\MaxTime or for a signal that ends it."""

from types import MappingProxyType
from typing import Any

from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.instructions.conditions import wait_for
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.signals import number_of
from mock_robot.rapid.tasks import ProgramTask


def _await_nobody(
    task: ProgramTask,
    most_s: float | None,
    digital_in: Slot | None,
    in_passive: bool | None,
    digital_out: Slot | None,
    out_passive: bool | None,
    flag: Slot | None,
    flag_passive: bool | None,
    broke: Slot | None,
) -> None:
    """The last eight options of every dialogue. Without \\BreakFlag what ends it is an error."""

    def ended_by() -> str | None:
        if digital_in is not None and bool(number_of(digital_in.value)) is not bool(in_passive):
            return "ERR_TP_DIBREAK"
        if digital_out is not None and bool(number_of(digital_out.value)) is not bool(out_passive):
            return "ERR_TP_DOBREAK"
        if flag is not None and bool(flag.value) is not bool(flag_passive):
            return "ERR_TP_PERSBOOLBREAK"
        return None

    wait_for(task, lambda: ended_by() is not None, most_s, Slot(False))
    name = ended_by() or "ERR_TP_MAXTIME"
    if broke is None:
        raise RapidError(name, "nobody answered at the pendant")
    broke.value = task.services.errors.numbers[name]


def ask(task: ProgramTask, *arguments: Any) -> float:
    """A dialogue whose last option is \\UIActiveSignal; the answer is 0 when nobody gave one."""
    _await_nobody(task, *arguments[-9:-1])
    return 0.0


def ask_text(task: ProgramTask, *arguments: Any) -> str:
    ask(task, *arguments)
    return ""


def read_at_pendant(task: ProgramTask, answer: Slot, *arguments: Any) -> None:
    """TPReadFK and TPReadNum."""
    _await_nobody(task, *arguments[-8:])


def show_message(task: ProgramTask, *arguments: Any) -> None:
    ask(task, *arguments)


def has_client(task: ProgramTask) -> bool:
    return False


DOES = MappingProxyType(
    {
        "UIMessageBox": ask,
        "UINumEntry": ask,
        "UINumTune": ask,
        "UIListView": ask,
        "UIAlphaEntry": ask_text,
        "UIMsgBox": show_message,
        "TPReadFK": read_at_pendant,
        "TPReadNum": read_at_pendant,
        "UIClientExist": has_client,
    }
)
