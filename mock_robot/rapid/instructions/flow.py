"""Waiting and ExitCycle; interrupts, also on entries of the event log (IError); booked error numbers; stop watches.

Traps run while an instruction waits. CONNECT is a statement, not an instruction. WaitTime of the motion task runs on
the arm's time, which may be scaled; all else is wire time: stop watches too, which overflow as a controller's do.
"""

from collections.abc import Callable
from types import MappingProxyType
from typing import Any

from mock_robot.rapid.errors import CycleLeft, RapidError
from mock_robot.rapid.instructions.conditions import wait_for
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.tasks import ProgramTask
from mock_robot.rapid.values import MAX_STRING_LENGTH, single

MIN_TIMER_S = 0.1


def i_pers(task: ProgramTask, once: bool | None, watched: tuple[Any, Slot], interrupt: Slot) -> None:
    task.services.interrupts.watch(watched[1], interrupt.value, bool(once))


def i_timer(task: ProgramTask, once: bool | None, seconds: float, interrupt: Slot) -> None:
    """A repeated one needs 0.1 s at least."""
    if not once and seconds < single(MIN_TIMER_S):
        raise RapidError("ERR_ARGVALERR", f"a repeated timer takes {MIN_TIMER_S} s at least")
    task.services.interrupts.repeat(interrupt.value, seconds, bool(once))


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


def clk_start(task: ProgramTask, clock: Slot) -> None:
    clk_read(task, clock)
    clock.value.start(task.now_s())


def clk_read(task: ProgramTask, clock: Slot, fine: bool | None = None) -> float:
    """Milliseconds, or microseconds with \\HighRes; the mock's clocks are as fine with and without.

    Raises ERR_OVERFLOW for a clock that has run for longer than a controller counts, until ClkReset.
    """
    seconds, most_s = float(clock.value.read_s(task.now_s())), task.services.max_clock_s
    if seconds > most_s:
        raise RapidError("ERR_OVERFLOW", f"the clock has run for more than {most_s:g} s")
    return seconds


POLL_S = 0.1
MIN_POLL_S = 0.04


def exit_cycle(task: ProgramTask) -> None:
    if task.motion:
        task.services.unit.clear()
    raise CycleLeft


def wait_time(task: ProgramTask, in_position: bool | None, seconds: float) -> None:
    """With \\InPos the time counts from standstill of the arm, but not before the instruction begins."""
    unit = task.services.unit
    if in_position:
        began_s = unit.now_s()
        while not unit.is_settled(seconds, began_s):
            task.wait(unit.settles_in_s(seconds, began_s))
    else:
        task.wait(seconds / (unit.time_scale if task.motion else 1.0))


def wait_until(
    task: ProgramTask,
    in_position: bool | None,
    condition: Callable[[], bool],
    max_time: float | None,
    time_flag: Slot | None,
    poll_rate: float | None,
    *shown: Any,
) -> None:
    """What the pendant shows meanwhile (\\Visualize) is left out."""
    poll_s = POLL_S if poll_rate is None else poll_rate
    if poll_s < single(MIN_POLL_S):
        raise RapidError("ERR_ARGVALERR", f"\\PollRate is {MIN_POLL_S} s at least")
    wait_for(task, condition, max_time, time_flag, poll_s)


def skip_warn(task: ProgramTask) -> None:
    """Keep the error that is being handled out of the event log."""
    if task.handled is not None:
        task.handled.logged = True


def tp_write(task: ProgramTask, text: str, *values: Any) -> None:
    shown = [text, *(str(each) for each in values if each is not None)]
    task.services.note(0, " ".join(shown))


def err_write(
    task: ProgramTask, warning: bool | None, info: bool | None, header: str, reason: str, *more: str | None
) -> None:
    kind = 80003 if info else 80002 if warning else 80001
    task.services.note(kind, ": ".join([header, reason, *(line for line in more if line)]))


DOES = MappingProxyType(
    {
        "ExitCycle": exit_cycle,
        "WaitTime": wait_time,
        "WaitUntil": wait_until,
        "SkipWarn": skip_warn,
        "TPWrite": tp_write,
        "ErrWrite": err_write,
        "IPers": i_pers,
        "ITimer": i_timer,
        "IDelete": lambda task, interrupt: task.services.interrupts.delete(interrupt),
        "IError": i_error,
        "GetTrapData": get_trap_data,
        "ReadErrData": read_err_data,
        "BookErrNo": book_err_no,
        "ClkReset": lambda task, clock: clock.value.reset(),
        "ClkStart": clk_start,
        "ClkRead": clk_read,
    }
)
