"""One connection to a Modbus device, with rules for trusting its answers."""

import asyncio
from dataclasses import dataclass, field

from drivers.errors import DeviceError, DeviceTimeout, GarbledAnswer
from drivers.timing import Timing
from drivers.transports.transport import Connection, Transport
from protocols.modbus.bit_reader import AnswerKind, BitReader
from protocols.modbus.client_framing import ClientFraming
from protocols.modbus.errors import HeaderBroken

FIX = "check the line, and that the device answers there"


@dataclass(eq=False)
class ModbusLine:
    """Opens on the first reading, and receives while it is open.

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
        """Disconnect."""
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
