"""Interlocks of the cell over Modbus: read afresh whenever motion is asked for; one that is not read does not allow it.

Not a safety function: the gate's switch stops the arm through the controller, this keeps a run from being begun.
"""

import asyncio
from dataclasses import dataclass, field
from typing import Literal
from urllib.parse import parse_qsl, urlsplit

from pymodbus.client import AsyncModbusSerialClient, AsyncModbusTcpClient
from pymodbus.exceptions import ModbusException

from drivers.errors import AddressNotUnderstood
from drivers.serial_errors import SERIAL_ERRORS, reason_of

DEFAULT_PORT = 502
FORM = "write tcp://host:502, or serial:///dev/ttyUSB0?baud=19200&parity=E"

Kind = Literal["coil", "discrete-input"]
Client = AsyncModbusTcpClient | AsyncModbusSerialClient


@dataclass(frozen=True)
class Signal:
    """Where an interlock is read, and which value allows motion."""

    name: str
    kind: Kind
    address: int
    allows: bool = True


@dataclass(frozen=True)
class Reading:
    """Does this interlock allow motion now, and if not, why."""

    name: str
    allows: bool
    why: str = ""


@dataclass(eq=False)
class Interlocks:
    """A Modbus client that dials when it is asked, and again when it was cut off."""

    address: str
    unit: int
    signals: tuple[Signal, ...]
    limit_s: float
    _client: Client | None = field(default=None, init=False)
    _turn: asyncio.Lock = field(default_factory=asyncio.Lock, init=False)

    async def readings(self) -> tuple[Reading, ...]:
        """Every interlock as it is now; within `limit_s`, whatever the device does."""
        async with self._turn:
            try:
                async with asyncio.timeout(self.limit_s):
                    return await self._read()
            except (TimeoutError, ModbusException, *SERIAL_ERRORS, ValueError) as error:
                self._hang_up()
                why = "no answer in time" if isinstance(error, TimeoutError) else _words(error)
                return tuple(Reading(s.name, False, f"cannot be read ({self.address}: {why})") for s in self.signals)

    async def close(self) -> None:
        """Hang up."""
        self._hang_up()

    async def _read(self) -> tuple[Reading, ...]:
        if self._client is None or not self._client.connected:
            self._hang_up()
            self._client = client_at(self.address, self.limit_s)
            if not await self._client.connect():
                raise OSError("nobody answers")
        return tuple([await self._reading(self._client, signal) for signal in self.signals])

    async def _reading(self, client: Client, signal: Signal) -> Reading:
        read = client.read_coils if signal.kind == "coil" else client.read_discrete_inputs
        answer = await read(signal.address, count=1, device_id=self.unit)
        if answer.isError() or not answer.bits:
            what = f"{signal.kind} {signal.address} is refused with exception {getattr(answer, 'exception_code', '?')}"
            return Reading(signal.name, False, f"cannot be read ({self.address}: {what})")
        value = bool(answer.bits[0])
        return Reading(signal.name, value is signal.allows, "" if value is signal.allows else f"is {int(value)}")

    def _hang_up(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None


def check_interlock_address(address: str) -> None:
    """Raises AddressNotUnderstood; opens nothing."""
    _parts(address)


def client_at(address: str, limit_s: float) -> Client:
    """A client that never dials by itself."""
    scheme, host, port, options = _parts(address)
    if scheme == "tcp":
        return AsyncModbusTcpClient(host, port=port, timeout=limit_s, retries=0, reconnect_delay=0)
    return AsyncModbusSerialClient(
        host,
        baudrate=int(options.get("baud", "19200")),
        parity=options.get("parity", "E"),
        timeout=limit_s,
        retries=0,
        reconnect_delay=0,
    )


def _parts(address: str) -> tuple[str, str, int, dict[str, str]]:
    """Scheme, host or device, port, options."""
    try:
        parts = urlsplit(address)
        host, port, options = parts.hostname or "", parts.port or DEFAULT_PORT, dict(parse_qsl(parts.query))
    except ValueError as error:
        raise AddressNotUnderstood(address, str(error), FORM) from error
    if parts.scheme == "tcp" and host and not parts.path and not options:
        return "tcp", host, port, options
    known = options.keys() <= {"baud", "parity"} and options.get("baud", "19200").isdecimal()
    if parts.scheme == "serial" and parts.path and known and options.get("parity", "E") in ("N", "E", "O"):
        return "serial", parts.path, 0, options
    raise AddressNotUnderstood(address, "it is not the address of a Modbus device", FORM)


def _words(error: Exception) -> str:
    return getattr(error, "string", "") or reason_of(error) or type(error).__name__
