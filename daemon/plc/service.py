"""Everything of the PLC, joined: the door, Modbus TCP, and RTU where the settings name a line."""

import random
from collections.abc import Iterator
from dataclasses import dataclass

from daemon.config.plc_settings import PlcSettings
from daemon.drift.monitor import DriftWatch
from daemon.http.listen_socket import listener_at
from daemon.operations import Operations
from daemon.plc.gateway import PlcDoor
from daemon.plc.rtu import ModbusRtu
from daemon.plc.tcp import Limits, ModbusTcp, Respond
from daemon.runtime.clock import Clock
from daemon.runtime.metrics import Metric
from daemon.runtime.version import VERSION
from protocols.modbus.bank import Identification, respond
from protocols.plc.handshake import Rules

IDENTIFICATION = Identification("handeyed", "handeyed", VERSION, name="eye-in-hand calibration")


@dataclass(frozen=True, eq=False)
class Plc:
    """Serves for as long as the daemon runs."""

    door: PlcDoor
    tcp: ModbusTcp
    rtu: ModbusRtu | None

    @classmethod
    def of(cls, settings: PlcSettings, operations: Operations, drift: DriftWatch, clock: Clock) -> "Plc":
        """Listening, not yet answering. Raises PortTaken."""
        rules = Rules(settings.word_order, settings.motion, settings.heartbeat_limit_s or None)
        door = PlcDoor(operations, drift, clock, rules)

        def respond_to(client: str) -> Respond:
            bank = door.bank(client, settings.may_write(client))
            return lambda pdu: respond(pdu, bank, IDENTIFICATION)

        limits = Limits(settings.connections, settings.idle_limit_s, comes_first=settings.may_write)
        tcp = ModbusTcp(listener_at(settings.host, settings.port, "plc"), respond_to, limits)
        line = settings.serial
        rtu = None if line is None else ModbusRtu(line, door.bank(line.port, True), IDENTIFICATION, random.random)
        return cls(door, tcp, rtu)

    async def start(self) -> None:
        self.door.start()
        await self.tcp.start()
        if self.rtu is not None:
            await self.rtu.start()

    async def stop(self) -> None:
        if self.rtu is not None:
            await self.rtu.stop()
        await self.tcp.stop()
        await self.door.stop()

    def warnings(self) -> list[str]:
        return []

    def families(self) -> Iterator[Metric]:
        """For GET /metrics."""
        yield Metric("handeyed_plc_connections", "gauge", "PLCs connected over Modbus TCP.",
                     {(): float(self.tcp.connections)})  # fmt: skip
