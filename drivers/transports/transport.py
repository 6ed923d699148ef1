"""What carries bytes to a device and back. TCP and serial lines are equal peers."""

from typing import Protocol


class Connection(Protocol):
    """An open way to the device. Every method raises LinkLost when it has gone."""

    async def send(self, data: bytes) -> None: ...

    async def receive(self) -> bytes:
        """At least one byte. May be cancelled without losing any."""
        ...

    async def close(self) -> None:
        """Never raises; may be called twice."""
        ...


class Transport(Protocol):
    """How to reach a device, again and again."""

    @property
    def address(self) -> str: ...

    @property
    def resynchronise(self) -> bool:
        """Look for the next frame behind dirt (a serial line), or close (TCP)?"""
        ...

    @property
    def half_frame_limit_s(self) -> float:
        """How long the rest of a frame may stay away."""
        ...

    async def connect(self) -> Connection:
        """Raises DeviceUnreachable."""
        ...
