"""Interlocks of the cell over Modbus, read before each motion; one that cannot be read does not allow it.

Not a safety function: the gate's switch stops the arm through the controller; this prevents a run from starting.
"""

import asyncio
from dataclasses import dataclass, field
from typing import Literal
from urllib.parse import parse_qsl, urlsplit

from drivers.errors import AddressNotUnderstood, DeviceError, DeviceTimeout, DeviceUnreachable, GarbledAnswer, LinkLost
from drivers.timing import Timing
from drivers.transports.serial_line import SerialTransport
from drivers.transports.tcp import TcpTransport
from drivers.transports.transport import Connection, Transport
from protocols.modbus.bit_reader import AnswerKind, Bit, BitReader
from protocols.modbus.client_framing import ClientFraming, RtuFraming, TcpFraming
from protocols.modbus.codes import Function
from protocols.modbus.errors import HeaderBroken

FIX = "check the line, and that the device answers there"
"""What to do where answers of a Modbus device cannot be trusted."""


@dataclass(eq=False)
class ModbusLine:
    """One connection to a Modbus device. Opens on the first reading, and receives while it is open.

    After a timeout, or an answer that fits no question or comes between readings, the next reading reopens the
    connection where answers are numbered (`reader.numbered`). Elsewhere the line stays open, and nothing is sent until
    nothing was received for `silence_s`.
    """

    transport: Transport
    framing: ClientFraming
    reader: BitReader
    silence_s: float
    timing: Timing
    _connection: Connection | None = field(default=None, init=False)
    _listener: asyncio.Task[None] | None = field(default=None, init=False)
    _answered: "asyncio.Future[None] | None" = field(default=None, init=False)
    _doubtful: bool = field(default=False, init=False)
    _heard_at_s: float = field(default=0.0, init=False)

    async def read(self) -> None:
        """Fill `reader.bits` and `reader.exceptions`; may be cancelled. Raises DeviceError."""
        if self._doubtful and self.reader.numbered:
            await self.close()
        elif self._doubtful and self.timing.clock() - self._heard_at_s < self.silence_s:
            what = f"waiting until the line was silent for {self.silence_s:g} s"
            raise DeviceTimeout(self.transport.address, what, FIX)
        self._doubtful = False
        connection = self._connection or await self._open()
        self.reader.begin()
        try:
            while (pdu := self.reader.request()) is not None:
                self._answered = asyncio.get_running_loop().create_future()
                await connection.send(self.framing.encode(pdu))
                await self._answered
        except BaseException:
            self._distrust()
            raise
        finally:
            self._answered = None

    async def close(self) -> None:
        listener, self._listener = self._listener, None
        connection, self._connection = self._connection, None
        if listener is not None:
            listener.cancel()
            await asyncio.gather(listener, return_exceptions=True)
        if connection is not None:
            await connection.close()

    async def _open(self) -> Connection:
        await self.close()
        connection = self._connection = await self.transport.connect()
        self.framing.reset()
        self._listener = asyncio.create_task(self._listen(connection), name=f"listens to {self.transport.address}")
        return connection

    async def _listen(self, connection: Connection) -> None:
        try:
            while True:
                data = await connection.receive()
                self._heard_at_s = self.timing.clock()
                for pdu in self.framing.feed(data):
                    self._hear(self.reader.receive(pdu))
        except HeaderBroken as error:
            self._lose(GarbledAnswer(self.transport.address, str(error), FIX))
        except DeviceError as error:
            self._lose(error)
        await connection.close()

    def _hear(self, answer: AnswerKind) -> None:
        """Handle an answer: late answers to older questions are normal within a reading, suspicious outside."""
        if self._answered is None or answer is AnswerKind.UNFIT:
            self._distrust()
        if self._answered is None or self._answered.done():
            return
        if answer is AnswerKind.AWAITED:
            self._answered.set_result(None)
        elif answer is AnswerKind.UNFIT:
            what = "an answer came that fits no question"
            self._answered.set_exception(GarbledAnswer(self.transport.address, what, FIX))

    def _lose(self, error: DeviceError) -> None:
        """Reopen the line at the next reading."""
        self._connection = None
        if self._answered is not None and not self._answered.done():
            self._answered.set_exception(error)

    def _distrust(self) -> None:
        self._doubtful = True
        self._heard_at_s = self.timing.clock()


DEFAULT_PORT = 502
FORM = "write tcp://host:502, or serial:///dev/ttyUSB0?baud=19200&parity=E"

Kind = Literal["coil", "discrete-input"]
FUNCTION: dict[Kind, Function] = {"coil": Function.READ_COILS, "discrete-input": Function.READ_DISCRETE_INPUTS}


@dataclass(frozen=True)
class InterlockSignal:
    """Address of an interlock's input, and the value that allows motion."""

    name: str
    kind: Kind
    address: int
    allows: bool = True

    @property
    def bit(self) -> Bit:
        return FUNCTION[self.kind], self.address


@dataclass(frozen=True)
class InterlockReading:
    """Whether an interlock allows motion now, with the reason if not."""

    name: str
    allows: bool
    why: str = ""


class Interlocks:
    """Reads the signals on demand; opens the line for the first reading, and again after a loss.

    A value is one the device had between question and answer, however the line delays or repeats answers (see
    protocols/modbus/bit_reader.py). Whatever is uncertain counts as unreadable.
    """

    def __init__(
        self,
        address: str,
        unit: int,
        signals: tuple[InterlockSignal, ...],
        limit_s: float,
        timing: Timing | None = None,
    ) -> None:
        """Opens nothing. Raises AddressNotUnderstood."""
        self.address, self._signals, self._limit_s = address, signals, limit_s
        self._timing = timing or Timing()
        numbered = parse_interlock_address(address)[0] == "tcp"
        self._reader = BitReader([signal.bit for signal in signals], numbered)
        framing: ClientFraming = TcpFraming(unit) if numbered else RtuFraming(unit)
        self._line = ModbusLine(transport_at(address), framing, self._reader, limit_s, self._timing)
        self._turn = asyncio.Lock()
        self._next: asyncio.Task[tuple[InterlockReading, ...]] | None = None

    async def readings(self) -> tuple[InterlockReading, ...]:
        """Every interlock, read after the call; within `limit_s`, or twice that when a reading is in progress.

        A call during a reading shares the next one.
        """
        if self._next is None:
            self._next = asyncio.create_task(self._read_next())
        return await asyncio.shield(self._next)

    async def close(self) -> None:
        async with self._turn:
            await self._line.close()

    async def _read_next(self) -> tuple[InterlockReading, ...]:
        async with self._turn:
            self._next = None
            error = await self._error_of_reading()
            if error is not None:
                return tuple(self._unread(signal, error) for signal in self._signals)
            return tuple(self._reading(signal) for signal in self._signals)

    async def _error_of_reading(self) -> str | None:
        """Read; returns the reason of a failure, None on success."""
        reading = asyncio.create_task(self._line.read())
        done = await self._timing.wait_until_done(reading, self._limit_s)
        reading.cancel()
        error = (await asyncio.gather(reading, return_exceptions=True))[0]
        if error is None:
            return None
        if not done:
            return "no answer in time"
        if not isinstance(error, DeviceError):
            raise error
        if isinstance(error, LinkLost):
            return "the connection was lost"
        refused = isinstance(error, DeviceUnreachable) and self._reader.numbered
        return f"nobody answers, {error.what}" if refused else error.what

    def _reading(self, signal: InterlockSignal) -> InterlockReading:
        if (code := self._reader.exceptions.get(signal.bit)) is not None:
            return self._unread(signal, f"{signal.kind} {signal.address} is refused with exception {code}")
        value = self._reader.bits[signal.bit]
        return InterlockReading(
            signal.name, value is signal.allows, "" if value is signal.allows else f"is {int(value)}"
        )

    def _unread(self, signal: InterlockSignal, why: str) -> InterlockReading:
        return InterlockReading(signal.name, False, f"cannot be read ({self.address}: {why})")


def transport_at(address: str) -> Transport:
    """Transport to a device. Raises AddressNotUnderstood."""
    scheme, host, port, options = parse_interlock_address(address)
    if scheme == "tcp":
        return TcpTransport(host, port)
    return SerialTransport(host, int(options.get("baud", "19200")), parity=options.get("parity", "E"))


def parse_interlock_address(address: str) -> tuple[str, str, int, dict[str, str]]:
    """Scheme, host or device, port, options. Raises AddressNotUnderstood; opens nothing."""
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
