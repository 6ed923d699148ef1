"""The PLC interface as one service: gateway, Modbus TCP, and Modbus RTU when the settings name a serial line."""

import random
from collections.abc import Iterator

from daemon.application import CellCamera
from daemon.config.plc_settings import PlcSettings
from daemon.http.listen_socket import open_listener
from daemon.runtime.clock import Clock
from daemon.runtime.metrics import Metric
from daemon.runtime.version import VERSION
from extensions.plc.gateway import PlcGateway
from extensions.plc.tcp import ModbusTcp, ModbusTcpLimits, Respond
from protocols.modbus.bank import Identification, respond
from protocols.plc.handshake import Rules

IDENTIFICATION = Identification("handeyed", "handeyed", VERSION, name="eye-in-hand calibration")


class PlcService:
    """Background service that runs as long as the settings name this PLC."""

    def __init__(self, settings: PlcSettings, cameras: tuple[CellCamera, ...], clock: Clock) -> None:
        """Bind the port; connections are accepted after `start`. Raises PortTaken."""
        rules = Rules(settings.word_order, settings.motion, settings.heartbeat_limit_s or None)
        self.gateway = gateway = PlcGateway(cameras, clock, rules)

        def respond_to(client: str) -> Respond:
            may_write = settings.may_write(client)
            bank, again = gateway.bank(client, may_write), gateway.bank(client, may_write, repeated=True)
            return lambda pdu, repeated: respond(pdu, again if repeated else bank, IDENTIFICATION)

        limits = ModbusTcpLimits(settings.connections, settings.idle_limit_s, has_priority=settings.may_write)
        self.tcp = ModbusTcp(open_listener(settings.host, settings.port, "plc"), respond_to, limits)
        self.rtu = None
        if (line := settings.serial) is not None:
            from extensions.plc.rtu import ModbusRtu  # with pymodbus, a third of a second

            self.rtu = ModbusRtu(line, gateway.bank(line.port, True), IDENTIFICATION, random.random)

    async def start(self) -> None:
        self.gateway.start()
        await self.tcp.start()
        if self.rtu is not None:
            await self.rtu.start()

    async def stop(self) -> None:
        if self.rtu is not None:
            await self.rtu.stop()
        await self.tcp.stop()
        await self.gateway.stop()

    def families(self) -> Iterator[Metric]:
        yield Metric("handeyed_plc_connections", "gauge", "PLCs connected over Modbus TCP.",
                     {(): float(self.tcp.connections)})  # fmt: skip
