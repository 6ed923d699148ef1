"""Errors of the drivers room. Every one says what happened, where, and what to do.

DeviceError
├── DeviceUnreachable      nobody answers at the address
├── DeviceTimeout          connected, but no answer (or no fresh one) in time
├── LinkLost               the connection broke while something was under way
├── GarbledAnswer          bytes came that are not the protocol, or not a picture or cloud
├── NothingMeasured        a whole cloud came, without a point in it
├── AnswerTooLarge         more bytes came than the configured limit allows
├── AddressNotUnderstood   an address whose scheme or parts name no driver (a ValueError, too)
├── RequestRefused         the controller refused to arm, or to tell something; carries its status name
├── MoveRefused            the controller refused a move before it began; carries its status name
├── MoveFailed             a move began and did not reach its goal
│   └── MoveStalled        it does not go on; whoever sees it stops the arm
└── InterlockRefused       an interlock of the cell does not allow motion; `interlocks` names which
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Literal

DeviceKind = Literal["robot", "camera", "scanner"]


class DeviceError(Exception):
    """Root. `device` is the configured name and address; `code` is stable; `fix` says what to do.

    `kind` is the kind of device that was asked; None when the error was raised outside the cell.
    """

    code = "device-error"
    kind: DeviceKind | None = None

    def __init__(self, device: str, what: str, fix: str) -> None:
        self.device, self.what, self.fix = device, what, fix
        super().__init__(f"{device}: {what}: {fix}")


class DeviceUnreachable(DeviceError):
    """Nobody answers at the address."""

    code = "device-unreachable"


class DeviceTimeout(DeviceError):
    """Connected, but no answer (or no fresh one) in time."""

    code = "device-timeout"


class LinkLost(DeviceError):
    """The connection broke while something was under way."""

    code = "link-lost"


class GarbledAnswer(DeviceError):
    """Bytes came that are not the protocol, or not a picture or cloud."""

    code = "garbled-answer"


class NothingMeasured(DeviceError):
    """A whole cloud came, without a point in it."""

    code = "nothing-measured"


class AnswerTooLarge(DeviceError):
    """More bytes came than the configured limit allows."""

    code = "answer-too-large"


class AddressNotUnderstood(DeviceError, ValueError):
    """An address whose scheme or parts name no driver. `device` is the address as it was given."""

    code = "address-not-understood"


class RequestRefused(DeviceError):
    """The controller refused to arm, or to tell something. `status` is the controller's status name."""

    code = "request-refused"

    def __init__(self, device: str, what: str, fix: str, status: str) -> None:
        super().__init__(device, what, fix)
        self.status = status


class MoveRefused(DeviceError):
    """The controller refused a move before it began. `status` is the controller's status name."""

    code = "move-refused"

    def __init__(self, device: str, what: str, fix: str, status: str) -> None:
        super().__init__(device, what, fix)
        self.status = status


class MoveFailed(DeviceError):
    """A move began and did not reach its goal."""

    code = "move-failed"

    def __init__(self, device: str, what: str, fix: str, status: str) -> None:
        super().__init__(device, what, fix)
        self.status = status


class MoveStalled(MoveFailed):
    """A move began and does not go on: it may still be under way, and is stopped."""

    def __init__(self, device: str, what: str, fix: str) -> None:
        super().__init__(device, what, fix, "STALLED")


class InterlockRefused(DeviceError):
    """An interlock of the cell does not allow motion; `interlocks` names which."""

    code = "interlock-open"

    def __init__(self, device: str, what: str, fix: str, interlocks: tuple[str, ...]) -> None:
        super().__init__(device, what, fix)
        self.interlocks = interlocks


@contextmanager
def errors_of(kind: DeviceKind) -> Iterator[None]:
    """Every DeviceError raised inside carries this `kind`, whatever the driver calls its device."""
    try:
        yield
    except DeviceError as error:
        error.kind = kind
        raise
