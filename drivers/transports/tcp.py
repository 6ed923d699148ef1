"""A byte stream over TCP."""

import asyncio
import os
import socket
from dataclasses import dataclass

from drivers.errors import DeviceUnreachable, LinkLost

CONNECT_LIMIT_S = 5.0
CLOSE_LIMIT_S = 1.0
CHUNK_BYTES = 4096
CHECK_ADDRESS = "check the address, and that the communication task runs on the controller"
KEEPALIVE = {socket.TCP_KEEPIDLE: 5, socket.TCP_KEEPINTVL: 2, socket.TCP_KEEPCNT: 3}
"""The heartbeat detects a dead peer first; keepalive frees the socket when the kernel is stuck as well."""


class TcpConnection:
    def __init__(self, device: str, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._device, self._reader, self._writer = device, reader, writer

    async def send(self, data: bytes) -> None:
        """Raises LinkLost."""
        try:
            self._writer.write(data)
            await self._writer.drain()
        except OSError as error:
            raise self._loss_error(error) from error

    async def receive(self) -> bytes:
        """At least one byte; raises LinkLost."""
        try:
            data = await self._reader.read(CHUNK_BYTES)
        except OSError as error:
            raise self._loss_error(error) from error
        if not data:
            raise LinkLost(
                self._device, "the controller closed the connection", "see whether its communication task runs"
            )
        return data

    async def close(self) -> None:
        """Close; unsent data is dropped when the peer does not accept it."""
        self._writer.close()
        try:
            async with asyncio.timeout(CLOSE_LIMIT_S):
                await self._writer.wait_closed()
        except TimeoutError:
            self._writer.transport.abort()
        except OSError:
            pass  # already broken: closed as well

    def _loss_error(self, error: OSError) -> LinkLost:
        return LinkLost(self._device, f"the connection broke ({error})", "check the network cable and the controller")


@dataclass(frozen=True)
class TcpTransport:
    """A device listening at host and port."""

    host: str
    port: int
    resynchronise: bool = False
    half_frame_limit_s: float = 2.0

    @property
    def address(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"tcp://{host}:{self.port}"

    async def connect(self) -> TcpConnection:
        """Raises DeviceUnreachable."""
        try:
            async with asyncio.timeout(CONNECT_LIMIT_S):
                reader, writer = await asyncio.open_connection(self.host, self.port)
        except TimeoutError as error:
            what = f"no answer to a connection in {CONNECT_LIMIT_S:g} s"
            raise DeviceUnreachable(self.address, what, "check address, cable and network port") from error
        except OSError as error:
            system = os.strerror(error.errno).lower() if error.errno and error.errno > 0 else ""  # without the address
            raise DeviceUnreachable(self.address, system or error.strerror or str(error), CHECK_ADDRESS) from error
        raw = writer.get_extra_info("socket")
        if raw.getsockname() == raw.getpeername():  # self-connection: a connect to a local port nobody listens on
            writer.transport.abort()
            raise DeviceUnreachable(self.address, "connection refused", CHECK_ADDRESS)
        raw.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        raw.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for option, value in KEEPALIVE.items():
            raw.setsockopt(socket.IPPROTO_TCP, option, value)
        return TcpConnection(self.address, reader, writer)
