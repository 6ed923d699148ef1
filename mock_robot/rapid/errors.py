"""Errors of the RAPID interpreter, and exceptions that leave a routine.

MockError
├── RapidSyntaxError    a module that cannot be parsed
└── RapidProgramError   a module that parses but that a controller would not start: unknown name, wrong argument
RapidError              a run-time error with a name, for an ERROR handler
RaisedFurther           the same, passed to the caller by RAISE in a handler
ProgramStopped          an error that nothing handles or that cannot be handled: the task's program stops
LongJump                a booked error on its way to the routine whose handler lists it
CycleLeft               ExitCycle, or the program pointer moved to main: all routines are left
"""

from mock_robot.errors import MockError


class RapidSyntaxError(MockError):
    """A module that cannot be parsed, with file, line and the text found."""

    def __init__(self, module: str, line: int, found: str) -> None:
        self.module, self.line, self.found = module, line, found
        super().__init__(f"{module}:{line}: {found}; only the RAPID subset of mock_robot/rapid/rapid.lark is read")


class RapidProgramError(MockError):
    """A module that a controller would not start, with file, line and reason."""

    def __init__(self, module: str, line: int, why: str) -> None:
        self.module, self.line, self.why = module, line, why
        super().__init__(f"{module}:{line}: {why}")


class RapidError(Exception):
    """A recoverable error with its RAPID name; the failing statement fills in `where`.

    `logged`: the event log has it, or SkipWarn has kept it out. `number`: of one that a program raised.
    """

    def __init__(self, name: str, detail: str, number: float | None = None) -> None:
        self.name, self.detail, self.where, self.number = name, detail, "", number
        self.logged = False
        super().__init__(f"{name}: {detail}")


class RaisedFurther(Exception):
    """A routine's handler passed the error to its caller."""

    def __init__(self, error: RapidError) -> None:
        self.error = error
        super().__init__(str(error))


class ProgramStopped(Exception):
    """The task's program stops; `code` is ABB's number for the event log."""

    def __init__(self, code: int, where: str, text: str) -> None:
        self.code, self.where, self.text = code, where, text
        super().__init__(f"{where}: {text}")


class LongJump(Exception):
    """RAISE of a number that the handler of a calling routine lists: all routines between are left, out of traps too.

    RAPID kernel manual 3HAC050946, error recovery with long jump; the example of ClearPath in 3HAC050917 uses it.
    """

    def __init__(self, error: RapidError, number: float) -> None:
        self.error, self.number = error, number
        super().__init__(str(error))


class CycleLeft(Exception):
    """All routines are left (their UNDO runs), then main restarts or the task ends."""
