"""Errors of the mock_robot room.

MockError
├── UnknownFault        no fault has that name; the message lists those there are
└── NoSuchState         a mode or switch position that no controller has
"""


class MockError(Exception):
    """Root."""


class UnknownFault(MockError):
    """No fault has that name."""

    def __init__(self, name: str, known: tuple[str, ...]) -> None:
        self.name, self.known = name, known
        super().__init__(f"no fault is named {name!r}: choose one of {', '.join(known)}")


class NoSuchState(MockError):
    """A mode or switch position that no controller has."""

    def __init__(self, what: str, value: object, known: tuple[str, ...]) -> None:
        self.what, self.value, self.known = what, value, known
        super().__init__(f"{what} {value!r} does not exist: choose one of {', '.join(known)}")
