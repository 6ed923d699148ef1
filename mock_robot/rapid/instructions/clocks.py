"""Stop watches. They run on wire time, even where the arm runs faster."""

from types import MappingProxyType

from mock_robot.rapid.scope import Slot
from mock_robot.rapid.tasks import ProgramTask


def clk_reset(task: ProgramTask, clock: Slot) -> None:
    clock.value.reset()


def clk_start(task: ProgramTask, clock: Slot) -> None:
    clock.value.start()


def clk_stop(task: ProgramTask, clock: Slot) -> None:
    clock.value.stop()


def clk_read(task: ProgramTask, clock: Slot) -> float:
    return float(clock.value.read_s())


DOES = MappingProxyType({"ClkReset": clk_reset, "ClkStart": clk_start, "ClkStop": clk_stop, "ClkRead": clk_read})
