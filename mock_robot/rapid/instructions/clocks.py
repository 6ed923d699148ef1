"""Stop watches. They run on wire time, even where the arm runs faster, and overflow as a controller's do."""

from types import MappingProxyType

from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.tasks import ProgramTask


def clk_reset(task: ProgramTask, clock: Slot) -> None:
    clock.value.reset()


def clk_start(task: ProgramTask, clock: Slot) -> None:
    _read_s(task, clock)
    clock.value.start(task.now_s())


def clk_read(task: ProgramTask, clock: Slot, fine: bool | None) -> float:
    """Milliseconds, or microseconds with \\HighRes; the mock's clocks are as fine with and without."""
    return _read_s(task, clock)


def _read_s(task: ProgramTask, clock: Slot) -> float:
    """Raises ERR_OVERFLOW for a clock that has run for longer than a controller counts, until ClkReset."""
    seconds, most_s = float(clock.value.read_s(task.now_s())), task.services.max_clock_s
    if seconds > most_s:
        raise RapidError("ERR_OVERFLOW", f"the clock has run for more than {most_s:g} s")
    return seconds


DOES = MappingProxyType({"ClkReset": clk_reset, "ClkStart": clk_start, "ClkRead": clk_read})
