"""What the driver asks of a vendor's library: find cameras, open one, read and write features, receive pictures.

Every call blocks and is made in a thread; a library's exceptions are raised as VendorError.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from importlib import import_module
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from drivers.errors import DeviceError, LibraryMissing

Class = TypeVar("Class", bound=type[Any])


class VendorError(Exception):
    """What a library says of a call that failed."""


def raises_vendor_errors(of_library: Callable[[], tuple[type[Exception], ...]]) -> Callable[[Class], Class]:
    """Decorator of a class whose public methods call a library: what this raises becomes a VendorError.

    `of_library`: the library's exceptions, asked for when one was raised, since the library may be missing before.
    """

    def convert(method: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(method)
        def call(*given: Any, **named: Any) -> Any:
            try:
                return method(*given, **named)
            except (VendorError, DeviceError):
                raise
            except of_library() as error:
                raise VendorError(str(error).strip()) from error

        return call

    def decorate(kind: Class) -> Class:
        for name, member in list(vars(kind).items()):
            if callable(member) and not name.startswith("_"):
                setattr(kind, name, convert(member))
        return kind

    return decorate


def import_library(module: str, extra: str) -> Any:
    """A vendor's Python module; its extra has the name of the address's scheme. Raises LibraryMissing."""
    try:
        return import_module(module)
    except ImportError as error:
        what = f"{module.partition('.')[0]} is not installed ({error})"
        raise LibraryMissing(f"camera {extra}:", what, f"pip install 'handeyed[{extra}]'") from error


@dataclass(frozen=True)
class FoundCamera:
    """A camera that answers discovery. `key`: how its library names it; `free`: False when another program has it."""

    vendor: str
    model: str
    serial: str
    address: str
    key: str
    user_name: str = ""
    free: bool = True

    def is_named(self, name: str) -> bool:
        """Whether a name in the settings is this camera's serial number, own name, address or key."""
        return name in (self.serial, self.user_name, self.address, self.key)

    def __str__(self) -> str:
        return f"{self.vendor} {self.model}, serial number {self.serial}".strip()


@dataclass(frozen=True, eq=False)
class RawPicture:
    """A buffer as received: bytes (n,), a PFNC code, bytes after each row; `complete` False when packets are missing.

    `device_time_ns`: the camera's own clock at the exposure, None where it has none. `parts`: further components of the
    same exposure, such as the intensity beside the coordinates of a 3D camera.
    """

    data: NDArray[np.uint8]
    format_code: int
    width: int
    height: int
    padding: int = 0
    device_time_ns: int | None = None
    complete: bool = True
    parts: tuple["RawPicture", ...] = ()


class OpenCamera(Protocol):
    """A camera that is open for control. All methods may raise VendorError."""

    def has(self, feature: str) -> bool:
        """Whether the camera has the feature and it can be used now."""
        ...

    def read(self, feature: str) -> str: ...

    def write(self, feature: str, value: str) -> None: ...

    def bounds(self, feature: str) -> tuple[float, float]:
        """Least and greatest value of a number."""
        ...

    def choices(self, feature: str) -> tuple[str, ...]:
        """Values that an enumeration allows now."""
        ...

    def execute(self, feature: str) -> None: ...

    def is_lost(self) -> bool:
        """Whether the camera is gone, or controlled by another program."""
        ...

    def start_stream(self) -> None:
        """Begin to receive pictures, none of them from before."""
        ...

    def stop_stream(self) -> None:
        """Stop, and drop what was received; nothing when no stream runs."""
        ...

    def next_picture(self, limit_s: float) -> RawPicture | None:
        """The next picture, as a copy; None when none comes in time."""
        ...

    def close(self) -> None: ...


class Library(Protocol):
    """A vendor's library. Both methods raise LibraryMissing where it is not installed, and VendorError."""

    def discover(self) -> list[FoundCamera]: ...

    def open(self, camera: FoundCamera) -> OpenCamera:
        """Open it for control. Raises DeviceTaken when another program controls it."""
        ...
