"""A serial line, or anything else pyserial opens: /dev/tty*, socket://, rfc2217://, loop://."""

import asyncio
import threading
from dataclasses import dataclass
from typing import Any

import serial

from drivers.errors import DeviceUnreachable, LinkLost
from drivers.serial_errors import SERIAL_ERRORS, reason_of

READ_LIMIT_S = 0.05
"""Timeout of a blocking read, after which it checks for the end."""
WRITE_LIMIT_S = 3.0
"""After it a write fails. pyserial says so of one that went out too, when its thread got no processor meanwhile."""
CHUNK_BYTES = 4096


class SerialConnection:
    """One open port: a thread reads, worker threads write, the event loop never blocks."""

    def __init__(self, device: str, port: Any) -> None:
        self._device, self._port = device, port
        self._loop = asyncio.get_running_loop()
        self._received: asyncio.Queue[bytes | LinkLost] = asyncio.Queue()
        self._ending = threading.Event()
        self._writing = threading.Lock()
        self._closed = False
        self._thread = threading.Thread(target=self._read, name=f"reads {device}", daemon=True)
        self._thread.start()

    async def send(self, data: bytes) -> None:
        """Raises LinkLost."""
        try:
            await asyncio.to_thread(self._write, data)
        except SERIAL_ERRORS as error:
            raise self._loss_error(error) from error

    async def receive(self) -> bytes:
        """At least one byte; raises LinkLost."""
        data = await self._received.get()
        if isinstance(data, LinkLost):
            self._received.put_nowait(data)
            raise self._loss_error(data.__cause__)
        return data

    async def close(self) -> None:
        """Stop the reading thread, then close the port."""
        if not self._closed:
            self._closed = True
            self._ending.set()
            await asyncio.to_thread(self._end)

    def _write(self, data: bytes) -> None:
        with self._writing:  # a cancelled request's write continues in its thread; a STOP must not interleave
            self._port.write(data)

    def _end(self) -> None:
        self._thread.join()
        self._port.close()

    def _read(self) -> None:
        try:
            while not self._ending.is_set():
                data = self._port.read(1)
                while data and len(data) < CHUNK_BYTES and (waiting := self._port.in_waiting):
                    data += self._port.read(waiting)
                if data:
                    self._hand_over(data)
        except SERIAL_ERRORS as error:
            lost = self._loss_error(error)
            lost.__cause__ = error
            self._hand_over(lost)

    def _hand_over(self, item: bytes | LinkLost) -> None:
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._received.put_nowait, item)

    def _loss_error(self, error: BaseException | None) -> LinkLost:
        return LinkLost(self._device, f"the serial line broke ({reason_of(error)})", "check the cable and the adapter")


@dataclass(frozen=True)
class SerialTransport:
    """A device at `port`: a device path or a pyserial URL. 8 bits, parity N, E or O, 1 stop bit.

    Never XON/XOFF, since frames are binary.
    """

    port: str
    baud: int = 115200
    rtscts: bool = False
    resynchronise: bool = True
    half_frame_limit_s: float = 0.2
    parity: str = "N"

    @property
    def address(self) -> str:
        return self.port if "://" in self.port else f"serial://{self.port}?baud={self.baud}"

    async def connect(self) -> SerialConnection:
        """Raises DeviceUnreachable."""
        opening = asyncio.ensure_future(asyncio.to_thread(self._open))
        try:
            port = await asyncio.shield(opening)
        except asyncio.CancelledError:
            opening.add_done_callback(_close_late_port)
            raise
        except (*SERIAL_ERRORS, ValueError) as error:
            fix = "check the port's name, that the adapter is plugged in, and the right to use it (group dialout)"
            raise DeviceUnreachable(self.address, f"the port cannot be opened ({reason_of(error)})", fix) from error
        return SerialConnection(self.address, port)

    def _open(self) -> Any:
        exclusive = {} if "://" in self.port else {"exclusive": True}
        port = serial.serial_for_url(
            self.port,
            baudrate=self.baud,
            parity=self.parity,
            rtscts=self.rtscts,
            write_timeout=WRITE_LIMIT_S,
            **exclusive,
        )
        try:
            port.timeout = READ_LIMIT_S  # sets the port up again, which fails for settings the adapter did not take
            port.reset_input_buffer()
        except BaseException:
            port.close()
            raise
        return port


def _close_late_port(opening: "asyncio.Future[Any]") -> None:
    """Close a port whose opener was cancelled; its error, if any, is dropped."""
    if not opening.cancelled() and opening.exception() is None:
        opening.result().close()
