"""Pieces of RAPID, run as the program of a task without a cabinet around it."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

from mock_robot.rapid.controller import MAX_CLOCK_S
from mock_robot.rapid.errors import ProgramStopped
from mock_robot.rapid.interrupts import Interrupts
from mock_robot.rapid.program import PersistentMemory, Program, Source
from mock_robot.rapid.scope import Data
from mock_robot.rapid.tasks import ProgramTask


def raise_failure(task: ProgramTask, stopped: ProgramStopped) -> None:
    """No controller: what stops a program by itself is raised to the test."""
    raise stopped


@dataclass
class Snippet:
    """A loaded module; `runs` its main once, in this thread."""

    text: str
    memory: PersistentMemory = field(default_factory=PersistentMemory)
    motion: bool = False
    noted: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.task = ProgramTask("T_TEST", raise_failure, self.motion)
        self.program = Program(self.task, self.memory, {})
        self.program.load([Source("TEST.mod", self.text)])
        self.task.services = SimpleNamespace(
            interrupts=Interrupts(self.task),
            errors=self.program.errors,
            unit=SimpleNamespace(clear=lambda: None, time_scale=1.0),
            note=lambda code, text: self.noted.append(text),
            max_clock_s=MAX_CLOCK_S,
        )
        self.task.running = True

    def runs(self) -> "Snippet":
        self.program.main()()
        return self

    def __getitem__(self, name: str) -> Any:
        symbol = self.program.scope.find(name)
        assert isinstance(symbol, Data)
        assert symbol.slot is not None
        return symbol.slot.value


def module(body: str, around: str = "", handler: str = "") -> str:
    """A module with that main, declarations and routines `around` it; data first, then routines."""
    data, _, routines = around.partition("---")
    error = f"ERROR\n{handler}\n" if handler else ""
    return f"MODULE SNIPPET\n{data}\n{routines}\nPROC main()\n{body}\n{error}ENDPROC\nENDMODULE\n"


def ran(body: str, around: str = "", handler: str = "") -> Snippet:
    """That module, run once."""
    return Snippet(module(body, around, handler)).runs()


def value_of(expression: str, kind: str = "num", data: str = "") -> Any:
    """What an expression gives."""
    return ran(f"result := {expression};", f"VAR {kind} result;\n{data}")["result"]
