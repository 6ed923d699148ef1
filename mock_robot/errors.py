"""Errors of mock_robot.

MockError
├── UnknownFault        no fault has this name; the message lists the known ones
├── NoSuchState         a mode or switch position that controllers do not have
└── JogRefused          the arm cannot be jogged there, or not now
"""


class MockError(Exception):
    """Root of mock_robot's errors."""


class UnknownFault(MockError):
    """No fault has this name."""

    def __init__(self, name: str, known: tuple[str, ...]) -> None:
        self.name, self.known = name, known
        super().__init__(f"no fault is named {name!r}: choose one of {', '.join(known)}")


class NoSuchState(MockError):
    """A mode or switch position that controllers do not have."""

    def __init__(self, what: str, value: object, known: tuple[str, ...]) -> None:
        self.what, self.value, self.known = what, value, known
        super().__init__(f"{what} {value!r} does not exist: choose one of {', '.join(known)}")


class JogRefused(MockError):
    """The arm cannot be jogged there, or not now."""
