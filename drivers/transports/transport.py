"""Interface of byte transports to devices, over TCP or a serial line."""

from typing import Protocol


class Connection(Protocol):
    """An open connection to the device. Every method raises LinkLost after its loss."""

    async def send(self, data: bytes) -> None: ...

    async def receive(self) -> bytes:
        """At least one byte. Cancellation loses none."""
        ...

    async def close(self) -> None:
        """Close. Never raises; may be called twice."""
        ...


class Transport(Protocol):
    """Opens connections to a device."""

    @property
    def address(self) -> str: ...

    @property
    def resynchronise(self) -> bool:
        """Whether to search for the next frame after garbage (serial line) or to close (TCP)."""
        ...

    @property
    def half_frame_limit_s(self) -> float:
        """Timeout for the rest of a frame."""
        ...

    async def connect(self) -> Connection:
        """Raises DeviceUnreachable."""
        ...
