"""Modbus RTU server on a serial line or a pyserial URL: framing by pymodbus, registers from our bank."""

import asyncio
import logging
from collections.abc import Callable

from pymodbus.constants import ExcCodes
from pymodbus.pdu.device import ModbusDeviceIdentification
from pymodbus.server import ModbusSerialServer
from pymodbus.simulator import DataType, SimData, SimDevice

from daemon.config.plc_settings import PlcSerialSettings
from daemon.runtime.tasks import InBackground
from drivers.backoff import Backoff
from drivers.serial_errors import SERIAL_ERRORS, reason_of
from protocols.modbus.bank import Bank, Identification
from protocols.modbus.codes import Function
from protocols.modbus.errors import ModbusException
from protocols.plc.bank import BITS
from protocols.plc.registers import SIZE

log = logging.getLogger(__name__)

READS_BITS = (Function.READ_COILS, Function.READ_DISCRETE_INPUTS)
WRITES_BITS = (Function.WRITE_COIL, Function.WRITE_COILS)


class ModbusRtu(InBackground):
    """Serves one line and reopens it when it is lost. The client on the line may write; no other can reach it."""

    def __init__(
        self, settings: PlcSerialSettings, bank: Bank, identification: Identification, chance: Callable[[], float]
    ) -> None:
        self._settings, self._bank, self._identification = settings, bank, identification
        self._backoff = Backoff(chance)
        self._lost = asyncio.Event()
        self._server: ModbusSerialServer | None = None
        self.opened = asyncio.Event()

    async def run(self) -> None:
        warned = False
        while True:
            try:
                self._server = self._make_server()
                await self._server.serve_forever(background=True)
                log.info("the PLC's serial line %s is open", self._settings.port)
                self._backoff.reset()
                warned = False
                self.opened.set()
                await self._lost.wait()
                log.warning("the PLC's serial line %s was lost; it is opened again by itself", self._settings.port)
            except (RuntimeError, *SERIAL_ERRORS) as error:
                if not warned:
                    log.warning("the PLC's serial line %s cannot be opened: %s", self._settings.port, reason_of(error))
                warned = True
            finally:
                self.opened.clear()
                self._lost.clear()
                if self._server is not None:
                    await self._server.shutdown()  # type: ignore[no-untyped-call]
                    self._server = None
            await asyncio.sleep(self._backoff.next_wait_s())

    def _make_server(self) -> ModbusSerialServer:
        settings, identification = self._settings, self._identification
        identity = ModbusDeviceIdentification(  # type: ignore[no-untyped-call]
            info_name={
                "VendorName": identification.vendor,
                "ProductCode": identification.product,
                "MajorMinorRevision": identification.revision,
            }
        )
        bits = [SimData(0, values=[False] * BITS, datatype=DataType.BITS)]
        words = [SimData(0, values=0, count=SIZE, datatype=DataType.REGISTERS)]
        device = SimDevice(settings.unit, (bits, bits, words, words), action=self._on_request)
        return ModbusSerialServer(
            device,
            identity=identity,
            port=settings.port,
            baudrate=settings.baud,
            parity=settings.parity,
            ignore_missing_devices=True,
            trace_connect=self._on_connection,
        )

    def _on_connection(self, up: bool) -> None:
        if not up:
            self._lost.set()

    async def _on_request(
        self,
        function: int,
        _start: int,
        address: int,
        count: int,
        registers: list[int],
        values: list[int] | list[bool] | None,
    ) -> ExcCodes | None:
        """pymodbus's hook before each access: apply writes to our bank, and copy its registers for the answer."""
        try:
            if values is not None:
                self._write(Function(function), address, values)
            registers[:] = self._image(Function(function))
        except ModbusException as refused:
            return ExcCodes(refused.code)
        return None

    def _write(self, function: Function, address: int, values: list[int] | list[bool]) -> None:
        if function in WRITES_BITS:
            self._bank.write_bits(address, [bool(value) for value in values])
        else:
            self._bank.write_words(address, [int(value) for value in values])

    def _image(self, function: Function) -> list[int]:
        """The whole register block from which pymodbus answers the request."""
        if function in READS_BITS or function in WRITES_BITS:
            table = Function.READ_DISCRETE_INPUTS if function is Function.READ_DISCRETE_INPUTS else Function.READ_COILS
            bits = self._bank.bits(table, 0, BITS)
            return [sum(bit << place for place, bit in enumerate(bits))]
        return list(self._bank.words(Function.READ_HOLDING_REGISTERS, 0, SIZE))
