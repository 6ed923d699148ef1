"""Errors of the RAPID interpreter, and the ways a program leaves a routine.

MockError
├── RapidSyntaxError    a module that cannot be read
└── RapidProgramError   a module that can be read and that no controller would start: unknown name, wrong argument
RapidError              a run-time error with a name, for an ERROR handler
RaisedFurther           the same on its way out of a routine whose handler did RAISE
ProgramStopped          nobody handled it, or it cannot be handled: the task's program stops
CycleLeft               ExitCycle, or the program pointer was moved to main: routines are dropped
"""

from mock_robot.errors import MockError


class RapidSyntaxError(MockError):
    """A module that cannot be read: which, where, and what stands there."""

    def __init__(self, module: str, line: int, found: str) -> None:
        self.module, self.line, self.found = module, line, found
        super().__init__(f"{module}:{line}: {found}; only the RAPID subset of mock_robot/rapid/rapid.lark is read")


class RapidProgramError(MockError):
    """A module that no controller would start: which, where, and why."""

    def __init__(self, module: str, line: int, why: str) -> None:
        self.module, self.line, self.why = module, line, why
        super().__init__(f"{module}:{line}: {why}")


class RapidError(Exception):
    """A recoverable error by its RAPID name; `where` is filled in by the statement that failed."""

    def __init__(self, name: str, detail: str) -> None:
        self.name, self.detail, self.where = name, detail, ""
        super().__init__(f"{name}: {detail}")


class RaisedFurther(Exception):
    """A routine's handler gave the error to its caller."""

    def __init__(self, error: RapidError) -> None:
        self.error = error
        super().__init__(str(error))


class ProgramStopped(Exception):
    """The task's program stops; `code` is ABB's number for the event log."""

    def __init__(self, code: int, where: str, text: str) -> None:
        self.code, self.where, self.text = code, where, text
        super().__init__(f"{where}: {text}")


class CycleLeft(Exception):
    """Every routine is dropped (their UNDO runs), and main begins anew; or the task ends."""
