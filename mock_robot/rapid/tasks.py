"""A program task: one thread that runs main repeatedly, stops between instructions, and runs traps there."""

import os
import select
import sys
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from time import monotonic
from typing import Any

from mock_robot.rapid.errors import CycleLeft, ProgramStopped, RaisedFurther, RapidError
from mock_robot.rapid.scope import Routine

EXECUTION_ERROR = 10020
"""ABB's event number: execution error state."""


ERROR = 3
"""TYPE_ERR of system.rapid."""


@dataclass(frozen=True)
class ErrorEvent:
    """An entry of the event log: domain and number within it (50050: 5 and 50), type (3: error), title, cause."""

    domain: int
    number: int
    type: int
    title: str
    cause: str


@dataclass(eq=False)
class ProgramTask:
    """One task. `attention` is checked between instructions; setting it also wakes a waiting instruction.

    As on a controller, an interrupt that comes while the task is stopped is lost. `now_s` is wire time; `handled` is
    the error whose handler runs; `settings` holds C_MOTSET; `event` is what called the current trap;
    `on_failure` stops a program that cannot go on; `booked` counts BookErrNo; `recovery_points` say for a number
    whether a routine under way lists it, outermost first.
    """

    name: str
    on_failure: Callable[["ProgramTask", ProgramStopped], None]
    motion: bool
    services: Any = None
    now_s: Callable[[], float] = monotonic
    handled: RapidError | None = field(default=None, init=False)
    attention: bool = field(default=True, init=False)
    running: bool = field(default=False, init=False)
    main: Callable[[], Any] | None = field(default=None, init=False)
    settings: Any = field(default=None, init=False)
    recovery_points: list[Callable[[float], bool]] = field(default_factory=list, init=False)
    event: ErrorEvent | None = field(default=None, init=False)
    booked: int = field(default=0, init=False)
    _turn: Any = field(default_factory=threading.RLock, init=False)
    _pending: "deque[tuple[Routine, ErrorEvent | None]]" = field(default_factory=deque, init=False)
    _trapping: bool = field(default=False, init=False)
    _undoing: bool = field(default=False, init=False)
    _leaving: bool = field(default=False, init=False)
    _ended: bool = field(default=False, init=False)

    def __post_init__(self) -> None:
        self._ear, self._mouth = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        self._thread = threading.Thread(target=self._live, name=f"rapid {self.name}", daemon=True)

    # --- called by the controller ---

    def begin(self, *, running: bool) -> None:
        """Start the thread, with the program pointer at main."""
        self.running = running
        self._thread.start()

    @property
    def is_current(self) -> bool:
        """Whether the calling thread is this task's."""
        return self._thread is threading.current_thread()

    def whereabouts(self) -> list[str]:
        """Current statements, innermost first, from the thread's stack; empty when the thread has ended."""
        found, frame = [], sys._current_frames().get(self._thread.ident or 0)
        while frame is not None:
            if frame.f_code.co_name == "run" and "lines" in (names := frame.f_locals) and "module" in names:
                found.append(f"{names['module']}:{names['lines'][names.get('at', 0)]}")
            frame = frame.f_back
        return found

    def start(self) -> None:
        """Resume a stopped task."""
        self.running = True
        self.rouse()

    def stop(self) -> None:
        """Stop before the next instruction, or inside one that waits; the program pointer stays."""
        with self._turn:
            self.running = False
            self._pending.clear()
        self.rouse()

    def move_pointer_to_main(self) -> None:
        """Leave every routine."""
        with self._turn:
            self._leaving = True
        self.rouse()

    def end(self, limit_s: float = 5.0) -> None:
        """Leave every routine and end the thread."""
        with self._turn:
            self._ended = True
        self.move_pointer_to_main()
        if self._thread.is_alive() and not self.is_current:
            self._thread.join(limit_s)

    def interrupt(self, trap: Routine, event: ErrorEvent | None = None) -> None:
        """Run the trap before the next instruction. Lost while the task is stopped."""
        with self._turn:
            if not self.running:
                return
            self._pending.append((trap, event))
        self.rouse()

    def rouse(self) -> None:
        """Wake a waiting task so that it checks its condition."""
        self.attention = True
        with suppress(BlockingIOError, OSError):
            os.write(self._mouth, b"\0")

    # --- called by the program ---

    def stop_by_itself(self, stopped: ProgramStopped) -> None:
        """Stop with the program pointer at the instruction that failed: a start tries it again.

        RAPID reference manual, basic characteristics, Error recovery.
        """
        self.on_failure(self, stopped)
        self.attention = True

    def undo(self, handler: Callable[[], Any]) -> None:
        """Run an UNDO handler: at once, though the program is stopped, and without traps."""
        self._undoing = True
        try:
            handler()
        finally:
            self._undoing = False

    def forget(self, trap: Routine | None = None) -> None:
        """Drop the trap, by default every one, where it is still to be run."""
        with self._turn:
            kept = [each for each in self._pending if trap is not None and each[0] is not trap]
            self._pending = deque(kept)

    def attend(self) -> None:
        """Between two instructions: wait while stopped, run pending traps. Raises CycleLeft."""
        while not self._undoing:
            with self._turn:
                if self._leaving:
                    self._leaving = False  # so that UNDO routines are not left a second time
                    raise CycleLeft
                trap = None
                if self.running or self._ended:
                    if not self._pending or self._trapping:
                        self.attention = False
                        return
                    trap = self._pending.popleft()
            if trap is None:
                self._listen(None)
            else:
                self._run_trap(*trap)

    def wait(self, seconds: float | None, fileno: int | None = None, until: Callable[[], bool] | None = None) -> bool:
        """Wait until the descriptor is readable or `until` holds (True), or a timeout; traps run meanwhile."""
        ends_s = None if seconds is None else self.now_s() + seconds
        while True:
            if self.attention:
                self.attend()
            if until is not None and until():
                return True
            left_s = None if ends_s is None else ends_s - self.now_s()
            if fileno is None and left_s is not None and left_s <= 0.0:
                return False
            if self._listen(left_s, fileno):
                return True
            if ends_s is not None and self.now_s() >= ends_s:
                return until is not None and until()

    def _listen(self, seconds: float | None, fileno: int | None = None) -> bool:
        """Wait until the descriptor is readable (True), the task is woken, or a timeout."""
        poll = select.poll()
        poll.register(self._ear, select.POLLIN)
        if fileno is not None:
            poll.register(fileno, select.POLLIN)
        ready = dict(poll.poll(None if seconds is None else max(0.0, 1000 * seconds)))
        if ready.pop(self._ear, 0):
            with suppress(BlockingIOError):
                os.read(self._ear, 4096)
        return bool(ready)

    def _run_trap(self, trap: Routine, event: ErrorEvent | None) -> None:
        assert trap.body is not None
        self._trapping, self.event = True, event
        try:
            trap.body([None] * (trap.places + 1))
        except RaisedFurther as raised:
            text = f"{raised.error} was raised out of a TRAP"
            raise ProgramStopped(EXECUTION_ERROR, raised.error.where, text) from raised
        finally:
            self._trapping = False

    # --- thread ---

    def _live(self) -> None:
        assert self.main is not None
        try:
            while not self._ended:
                try:
                    with self._turn:
                        self._leaving = self._ended
                    self.attend()
                    self.main()
                except CycleLeft:
                    continue
                except ProgramStopped as stopped:
                    self.stop_by_itself(stopped)
        finally:
            # -1 from now on: the numbers may be reused by other files
            ends, self._ear, self._mouth = (self._ear, self._mouth), -1, -1
            for end in ends:
                os.close(end)
