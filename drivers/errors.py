"""Errors of drivers. Each says what happened, at which device, and what to do.

DeviceError
├── DeviceUnreachable      no answer at the address
├── DeviceTaken            another program controls the device
├── WrongDevice            another device answers than the settings name
├── LibraryMissing         the library that the driver needs is not installed
├── SettingRefused         the device does not have a setting, or refuses its value
├── DeviceOverheated       the device is too hot to measure
├── DeviceTimeout          connected, but no answer (or no fresh one) in time
│   └── StreamStalled      a camera is connected and sends no pictures
├── LinkLost               the connection broke during a request
├── GarbledAnswer          the bytes are not of the protocol, or not an image or cloud
│   └── IncompletePicture  parts of a picture are missing
├── NothingMeasured        a complete cloud without points
├── ClocksApart            the clocks of device and daemon run apart
├── SweepNeeded            a line profiler was asked for a whole cloud
├── AnswerTooLarge         more bytes than the configured limit
├── AddressNotUnderstood   an address that no driver can parse (a ValueError, too)
├── RequestRefused         the controller refused to arm or to answer; carries its status name
├── MoveRefused            the controller refused a move before it began; carries its status name
├── MoveFailed             a move began and did not reach its goal
│   └── MoveStalled        it makes no progress; the caller stops the arm
└── InterlockRefused       an interlock of the cell does not allow motion; `interlocks` names it
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Literal

from calibration.errors import CodedError

DeviceKind = Literal["robot", "camera", "scanner"]


class DeviceError(CodedError, code="device-error"):
    """Root of the drivers' errors. `device`: configured name and address; `code` is stable; `fix` says what to do.

    `kind`: kind of device; None when the error was raised outside the cell. `status`: the controller's name of it.
    """

    kind: DeviceKind | None = None

    def __init__(self, device: str, what: str, fix: str, status: str = "") -> None:
        self.device, self.what, self.fix, self.status = device, what, fix, status
        super().__init__(f"{device}: {what}: {fix}")


class DeviceUnreachable(DeviceError, code="device-unreachable"):
    """No answer at the address."""


class DeviceTaken(DeviceError, code="device-taken"):
    """Another program controls the device."""

    def __init__(
        self, device: str, what: str, fix: str = "close the program that uses it, or restart the device"
    ) -> None:
        super().__init__(device, what, fix)


class WrongDevice(DeviceError, code="wrong-device"):
    """Another device answers than the settings name."""


class LibraryMissing(DeviceError, code="library-missing"):
    """The library that the driver needs is not installed."""


class SettingRefused(DeviceError, code="setting-refused"):
    """The device does not have a setting, or refuses its value."""


class DeviceTimeout(DeviceError, code="device-timeout"):
    """No answer, or no fresh one, in time: of a device that is connected, or whose connection is still being made."""


class DeviceOverheated(DeviceError, code="device-overheated"):
    """The device is too hot to measure."""


class StreamStalled(DeviceTimeout, code="stream-stalled"):
    """A camera is connected and sends no pictures."""


class LinkLost(DeviceError, code="link-lost"):
    """The connection broke during a request."""


class GarbledAnswer(DeviceError, code="garbled-answer"):
    """The bytes are not of the protocol, or not an image or cloud."""


class IncompletePicture(GarbledAnswer, code="incomplete-picture"):
    """Parts of a picture are missing."""

    def __init__(
        self,
        device: str,
        what: str,
        fix: str = "check cable and switch, and set packet_bytes to what the network carries (1500, or 9000)",
    ) -> None:
        super().__init__(device, what, fix)


class NothingMeasured(DeviceError, code="nothing-measured"):
    """A complete cloud without points."""


class ClocksApart(DeviceError, code="clocks-apart"):
    """The clocks of device and daemon run apart: `by_s` since the sweep began."""

    def __init__(self, device: str, by_s: float) -> None:
        super().__init__(
            device,
            f"its clock has moved by {by_s * 1e3:+.0f} ms against this machine's since the sweep began",
            "let the sensor send for some seconds before a sweep, and check that its stamps are microseconds",
        )


class SweepNeeded(DeviceError, code="sweep-needed"):
    """A line profiler was asked for a whole cloud."""

    def __init__(self, device: str) -> None:
        super().__init__(
            device,
            "a line profiler measures one line at a time, while the arm moves",
            "begin a sweep with POST /sweeps, move the arm, and end it",
        )


class AnswerTooLarge(DeviceError, code="answer-too-large"):
    """More bytes than the configured limit."""


class AddressNotUnderstood(DeviceError, ValueError, code="address-not-understood"):
    """An address that no driver can parse. `device` is the address as given."""


class RequestRefused(DeviceError, code="request-refused"):
    """The controller refused to arm or to answer. `status` is the controller's status name."""


class MoveRefused(DeviceError, code="move-refused"):
    """The controller refused a move before it began. `status` is the controller's status name."""


class MoveFailed(DeviceError, code="move-failed"):
    """A move began and did not reach its goal."""


class MoveStalled(MoveFailed):
    """A move began and makes no progress: it may still be active, and is stopped."""

    def __init__(self, device: str, what: str, fix: str) -> None:
        super().__init__(device, what, fix, "STALLED")


class InterlockRefused(DeviceError, code="interlock-open"):
    """An interlock of the cell does not allow motion; `interlocks` names it."""

    def __init__(self, device: str, what: str, fix: str, interlocks: tuple[str, ...]) -> None:
        super().__init__(device, what, fix)
        self.interlocks = interlocks


@contextmanager
def errors_of(kind: DeviceKind) -> Iterator[None]:
    """Set `kind` on every DeviceError raised inside."""
    try:
        yield
    except DeviceError as error:
        error.kind = kind
        raise
