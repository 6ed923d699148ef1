"""IPers, ITimer and IDelete. CONNECT is a statement, not an instruction."""

from types import MappingProxyType
from typing import Any

from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.tasks import ProgramTask
from mock_robot.rapid.values import single

MIN_TIMER_S = 0.1


def i_pers(task: ProgramTask, once: bool | None, watched: tuple[Any, Slot], interrupt: Slot) -> None:
    task.services.interrupts.watch(watched[1], interrupt.value, bool(once))


def i_timer(task: ProgramTask, once: bool | None, seconds: float, interrupt: Slot) -> None:
    """A repeated one needs 0.1 s at least."""
    if not once and seconds < single(MIN_TIMER_S):
        raise RapidError("ERR_ARGVALERR", f"a repeated timer takes {MIN_TIMER_S} s at least")
    task.services.interrupts.repeat(interrupt.value, seconds, bool(once))


def i_delete(task: ProgramTask, interrupt: Slot) -> None:
    task.services.interrupts.delete(interrupt)


DOES = MappingProxyType({"IPers": i_pers, "ITimer": i_timer, "IDelete": i_delete})
