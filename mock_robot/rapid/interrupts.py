"""Interrupts: CONNECT assigns a trap a number, IPers and ITimer trigger it, IDelete removes it."""

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count
from typing import Any

from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.scope import CompileContext, Data, Frame, Persistent, Routine, Slot
from mock_robot.rapid.syntax import Node, line_of, name, word
from mock_robot.rapid.tasks import ErrorEvent, ProgramTask
from mock_robot.rapid.types import NUM


@dataclass
class Interrupt:
    """A connected interrupt: its trap, and the PERS, the timer or the entries of the event log that trigger it."""

    trap: Routine
    watched: Persistent | None = None
    notice: Callable[[], None] | None = None
    timer: threading.Event | None = None
    errors: tuple[int, int, float | None] | None = None

    def end(self) -> None:
        if self.timer is not None:
            self.timer.set()
        if self.watched is not None:
            self.watched.watchers = tuple(each for each in self.watched.watchers if each is not self.notice)


@dataclass
class Interrupts:
    task: ProgramTask
    _orders: dict[float, Interrupt] = field(default_factory=dict, init=False)
    _numbers: Any = field(default_factory=lambda: count(1), init=False)
    _turn: Any = field(default_factory=threading.Lock, init=False)

    def connect(self, slot: Slot, trap: Routine) -> None:
        """Assign a number to the trap. Raises ERR_ALRDYCNT for a variable that is already connected."""
        with self._turn:
            if slot.value in self._orders:
                raise RapidError("ERR_ALRDYCNT", "the interrupt is connected already: IDelete first")
            slot.value = float(next(self._numbers))
            self._orders[slot.value] = Interrupt(trap)

    def watch(self, slot: Slot, number: float, once: bool) -> None:
        """Trigger at every change of a PERS, or at the first one."""
        if not isinstance(slot, Persistent):
            raise RapidError("ERR_ARGVALERR", "only a whole PERS can be watched")
        order = self._renew(number)

        def notice() -> None:
            if once:
                order.end()
            self.task.interrupt(order.trap)

        order.watched, order.notice = slot, notice
        slot.watchers = (*slot.watchers, notice)

    def _renew(self, number: float) -> Interrupt:
        """The interrupt of that number, without what it watched. Raises ERR_UNKINO."""
        order = self._orders.get(number)
        if order is None:
            raise RapidError("ERR_UNKINO", f"interrupt {number:g} is not connected")
        order.end()
        return order

    def repeat(self, number: float, period_s: float, once: bool) -> None:
        """Trigger every `period_s` of wire time, or once after it."""
        order = self._renew(number)
        ended = order.timer = threading.Event()

        def tick() -> None:
            while not ended.wait(period_s):
                self.task.interrupt(order.trap)
                if once:
                    return

        threading.Thread(target=tick, name=f"rapid timer of {self.task.name}", daemon=True).start()

    def watch_errors(self, number: float, domain: int, kind: int, error: float | None) -> None:
        """Trigger at every entry of the event log of that domain (0: any), type (0: any) and number (None: any)."""
        order = self._renew(number)
        order.errors = (domain, kind, error)

    def note_event(self, event: ErrorEvent) -> None:
        """Trigger what watches for such an entry."""
        for order in list(self._orders.values()):
            if order.errors is None:
                continue
            domain, kind, error = order.errors
            if domain in (0, event.domain) and kind in (0, event.type) and error in (None, event.number):
                self.task.interrupt(order.trap, event)

    def delete(self, slot: Slot) -> None:
        """Remove the interrupt; no error for an unknown one."""
        with self._turn:
            order = self._orders.pop(slot.value, None)
            slot.value = 0.0
        if order is not None:
            order.end()
            self.task.forget(order.trap)

    def end(self) -> None:
        with self._turn:
            orders = list(self._orders.values())
            self._orders.clear()
        for order in orders:
            order.end()
        self.task.forget()


def connection(context: CompileContext, node: Node) -> Callable[[Frame], None]:
    """Compile CONNECT of a module's variable WITH a trap."""
    symbol, trap = context.scope.find(name(node, 0)), context.scope.find(name(node, 1))
    if not isinstance(symbol, Data) or symbol.type != NUM or symbol.storage != "var" or symbol.slot is None:
        raise context.wrong(line_of(node), f"CONNECT wants a VAR intnum of a module, {word(node, 0)} is not one")
    if not isinstance(trap, Routine) or trap.kind != "trap":
        raise context.wrong(line_of(node), f"no TRAP is named {word(node, 1)}")
    slot, task = symbol.slot, context.task
    return lambda frame: task.services.interrupts.connect(slot, trap)
