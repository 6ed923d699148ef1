"""Stop watches. They run on wire time, also where the arm runs faster."""

from types import MappingProxyType

from mock_robot.rapid.scope import Slot
from mock_robot.rapid.tasks import Task


def clk_reset(task: Task, clock: Slot) -> None:
    clock.value.reset()


def clk_start(task: Task, clock: Slot) -> None:
    clock.value.start()


def clk_stop(task: Task, clock: Slot) -> None:
    clock.value.stop()


def clk_read(task: Task, clock: Slot) -> float:
    return float(clock.value.read_s())


DOES = MappingProxyType({"ClkReset": clk_reset, "ClkStart": clk_start, "ClkStop": clk_stop, "ClkRead": clk_read})
