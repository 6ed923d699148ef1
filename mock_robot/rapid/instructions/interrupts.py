"""IPers, IDelete, IDisable and IEnable. CONNECT is a statement, not an instruction."""

from types import MappingProxyType
from typing import Any

from mock_robot.rapid.scope import Slot
from mock_robot.rapid.tasks import ProgramTask


def i_pers(task: ProgramTask, watched: tuple[Any, Slot], interrupt: Slot, single: bool | None) -> None:
    task.services.interrupts.watch(watched[1], interrupt.value, bool(single))


def i_delete(task: ProgramTask, interrupt: Slot) -> None:
    task.services.interrupts.delete(interrupt)


def i_disable(task: ProgramTask) -> None:
    task.interrupts_disabled = True


def i_enable(task: ProgramTask) -> None:
    task.interrupts_disabled = False
    task.rouse()


DOES = MappingProxyType({"IPers": i_pers, "IDelete": i_delete, "IDisable": i_disable, "IEnable": i_enable})
