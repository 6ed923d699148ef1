"""Interrupts: CONNECT gives a trap a number, IPers rings it when a PERS changes, IDelete takes it away."""

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count
from typing import Any

from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.scope import Context, Data, Frame, Persistent, Routine, Slot
from mock_robot.rapid.syntax import Node, line_of, name, word
from mock_robot.rapid.tasks import Task
from mock_robot.rapid.types import NUM


@dataclass
class Order:
    """A connected interrupt: its trap, and what rings it."""

    trap: Routine
    watched: Persistent | None = None
    notice: Callable[[], None] | None = None

    def end(self) -> None:
        """It rings no more."""
        if self.watched is not None:
            self.watched.watchers = tuple(each for each in self.watched.watchers if each is not self.notice)


@dataclass
class Interrupts:
    """The interrupts of one task, by their numbers."""

    task: Task
    _orders: dict[float, Order] = field(default_factory=dict, init=False)
    _numbers: Any = field(default_factory=lambda: count(1), init=False)
    _turn: Any = field(default_factory=threading.Lock, init=False)

    def connect(self, slot: Slot, trap: Routine) -> None:
        """A number for the trap. Raises ERR_ALRDYCNT for a variable that is connected already."""
        with self._turn:
            if slot.value in self._orders:
                raise RapidError("ERR_ALRDYCNT", "the interrupt is connected already: IDelete first")
            slot.value = float(next(self._numbers))
            self._orders[slot.value] = Order(trap)

    def watch(self, slot: Slot, number: float, once: bool) -> None:
        """Ring at every change of a PERS."""
        order = self._orders.get(number)
        if order is None:
            raise RapidError("ERR_UNKINO", f"interrupt {number:g} is not connected")
        if not isinstance(slot, Persistent):
            raise RapidError("ERR_ARGVALERR", "only a whole PERS can be watched")
        order.end()

        def notice() -> None:
            if once:
                order.end()
            self.task.interrupt(order.trap)

        order.watched, order.notice = slot, notice
        slot.watchers = (*slot.watchers, notice)

    def delete(self, slot: Slot) -> None:
        """Forget the interrupt; an unknown one is no error."""
        with self._turn:
            order = self._orders.pop(slot.value, None)
            slot.value = 0.0
        if order is not None:
            order.end()

    def end(self) -> None:
        """Forget all."""
        for order in self._orders.values():
            order.end()
        self._orders.clear()


def connection(context: Context, node: Node) -> Callable[[Frame], None]:
    """CONNECT a variable of a module WITH a trap."""
    symbol, trap = context.scope.find(name(node, 0)), context.scope.find(name(node, 1))
    if not isinstance(symbol, Data) or symbol.type != NUM or symbol.storage != "var" or symbol.slot is None:
        raise context.wrong(line_of(node), f"CONNECT wants a VAR intnum of a module, {word(node, 0)} is none")
    if not isinstance(trap, Routine) or trap.kind != "trap":
        raise context.wrong(line_of(node), f"no TRAP is named {word(node, 1)}")
    slot, task = symbol.slot, context.task
    return lambda frame: task.services.interrupts.connect(slot, trap)
