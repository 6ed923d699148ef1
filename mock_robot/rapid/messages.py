"""RAPID message queues: one a task, found by its name; messages hold a value with its type."""

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from mock_robot.rapid.types import Atom, Type

MAX_MESSAGES = 50


class QueueSlot:
    """An rmqslot: the name of the task whose queue it is."""

    def __init__(self) -> None:
        self.task = ""


class Message:
    """An rmqmessage: a value, its type, and who sent it."""

    def __init__(self, kind: Type | None = None, value: Any = None, sender: str = "") -> None:
        self.kind, self.value, self.sender = kind, value, sender


class Meetings:
    """Tasks that wait for each other, by the names of those that take part."""

    def __init__(self) -> None:
        self._turn = threading.Lock()
        self._here: dict[frozenset[str], set[str]] = {}
        self._held: dict[frozenset[str], int] = {}

    def enter(self, names: frozenset[str], name: str) -> Callable[[], bool]:
        """One of them waits from now on; returns what says whether all have come."""
        with self._turn:
            here, number = self._here.setdefault(names, set()), self._held.get(names, 0)
            here.add(name)
            if here == names:
                self._here.pop(names)
                self._held[names] = number + 1
        return lambda: self._held.get(names, 0) > number

    def leave(self, names: frozenset[str], name: str) -> None:
        """One of them waits no longer."""
        with self._turn:
            self._here.get(names, set()).discard(name)


@dataclass
class MessageQueues:
    """Queues of a controller's tasks. `wanted`: by task and type name what to call when a message comes.

    `flags`: held while TestAndSet looks and writes. `meetings`: of WaitSyncTask.
    """

    tasks: set[str] = field(default_factory=set)
    flags: Any = field(default_factory=threading.Lock)
    meetings: Meetings = field(default_factory=Meetings)
    wanted: dict[tuple[str, str], Callable[[], None]] = field(default_factory=dict)
    _queues: dict[str, deque[Message]] = field(default_factory=dict)
    _turn: Any = field(default_factory=threading.RLock)

    def put(self, task: str, message: Message) -> bool:
        """Add to a task's queue; False when it is full."""
        with self._turn:
            queue = self._queues.setdefault(task, deque())
            if len(queue) >= MAX_MESSAGES:
                return False
            queue.append(message)
        if message.kind is not None and (notice := self.wanted.get((task, message.kind.name))) is not None:
            notice()
        return True

    def take(self, task: str) -> Message | None:
        """The oldest message of a task, or None."""
        with self._turn:
            queue = self._queues.get(task)
            return queue.popleft() if queue else None

    def clear(self, task: str) -> None:
        """Empty a task's queue."""
        with self._turn:
            self._queues.pop(task, None)


RMQSLOT = Atom("rmqslot", QueueSlot, device=True)
RMQMESSAGE = Atom("rmqmessage", Message, device=True)
