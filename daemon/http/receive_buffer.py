"""Where the bytes of all connections come in: one place that the system fills, instead of new memory for each piece.

For a cloud that passes by this is one copy fewer, and four times fewer pieces: uvloop reads at most 256,000 bytes into
memory of its own.
"""

import asyncio
from typing import Any, Protocol

BUFFER_BYTES = 1 << 20
"""Larger pieces no longer fit the processor's caches; smaller ones cost more to hand on."""


class SharedBuffer:
    """Used by one connection at a time, from the moment it asks for the buffer until it has read what is in it."""

    def __init__(self, size: int = BUFFER_BYTES) -> None:
        self.buffer = memoryview(bytearray(size))


class ConnectionProtocol(Protocol):
    """A connection; like asyncio's Protocol, but it keeps no reference to what it is told."""

    def connection_made(self, transport: Any) -> None: ...
    def data_received(self, data: memoryview) -> None: ...
    def eof_received(self) -> bool | None: ...
    def connection_lost(self, exc: Exception | None) -> None: ...
    def pause_writing(self) -> None: ...
    def resume_writing(self) -> None: ...


class BufferedConnection(asyncio.BufferedProtocol):
    """Tells its connection what the system has put into the room, and everything else."""

    def __init__(self, connection: ConnectionProtocol, buffer: SharedBuffer) -> None:
        self._connection, self._shared = connection, buffer

    def get_buffer(self, sizehint: int) -> memoryview:
        return self._shared.buffer

    def buffer_updated(self, nbytes: int) -> None:
        self._connection.data_received(self._shared.buffer[:nbytes])

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._connection.connection_made(transport)

    def eof_received(self) -> bool | None:
        return self._connection.eof_received()

    def connection_lost(self, exc: Exception | None) -> None:
        self._connection.connection_lost(exc)

    def pause_writing(self) -> None:
        self._connection.pause_writing()

    def resume_writing(self) -> None:
        self._connection.resume_writing()
