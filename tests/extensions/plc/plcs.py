"""A PLC's program for tests: reads by name, writes bits, waits for status as a ladder would."""

import asyncio
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import Any

from pymodbus.client import AsyncModbusTcpClient

from extensions.plc.extension import PlcSwitch
from extensions.plc.service import PlcService
from protocols.modbus.words import WordOrder, crc16, text_of, unsigned_of
from protocols.plc.codes import ControlBit, StatusBit
from protocols.plc.registers import BY_NAME, RESULT, SIZE, Kind
from tests.daemon.cell_under_test import Bench
from tests.support.registers import float_of, integer_of
from tests.support.waiting import LIMIT_S

MOVING = {"port": 0, "writers": ["127.0.0.1"], "motion": True}
"""[plc] of a PLC that may move the arm."""

NONE = StatusBit(0)

READERS = {Kind.FLOAT32: float_of, Kind.INT32: integer_of, Kind.UINT32: unsigned_of}


def plc_of(bench: Bench) -> PlcService:
    service = bench.application.service(PlcSwitch).service
    assert service is not None
    return service


def value_of(image: list[int], name: str, order: WordOrder = WordOrder.HIGH_FIRST) -> Any:
    """One named value of all registers."""
    register = BY_NAME[name]
    words = image[register.address : register.address + register.registers]
    if register.kind in READERS:
        return READERS[register.kind](words, order)
    return text_of(words) if register.kind is Kind.TEXT24 else words[0]


@dataclass
class Ladder:
    """Somebody with pymodbus."""

    client: Any
    control: ControlBit = field(default=ControlBit(0))

    async def image(self) -> list[int]:
        """Every register: two reads, as no PLC takes more than 125 at once."""
        first = await self.client.read_holding_registers(0, count=RESULT)
        second = await self.client.read_input_registers(RESULT, count=SIZE - RESULT)
        return [*first.registers, *second.registers]

    async def status(self) -> StatusBit:
        return StatusBit((await self.client.read_input_registers(16, count=1)).registers[0])

    async def sets(self, control: ControlBit) -> None:
        self.control = control
        answer = await self.client.write_register(0, int(control))
        assert not answer.isError(), answer

    async def waits(self, wanted: StatusBit, unwanted: StatusBit = NONE, within_s: float = LIMIT_S) -> StatusBit:
        ends_s = time.monotonic() + within_s  # a cancellation by asyncio.timeout may be lost in pymodbus
        while time.monotonic() < ends_s:
            status = await self.status()
            if status & wanted == wanted and not status & unwanted:
                return status
            await asyncio.sleep(0.01)
        raise TimeoutError(f"the status had not {wanted!r} without {unwanted!r} in {within_s:g} s")

    async def triggers(self, trigger: ControlBit) -> StatusBit:
        """Until it is answered; then lets go."""
        await self.sets(ControlBit(0))
        await self.sets(trigger)
        status = await self.waits(StatusBit.TRIGGER_ACK)
        await self.sets(ControlBit(0))
        await self.waits(StatusBit(0), unwanted=StatusBit.TRIGGER_ACK)
        return status

    async def result(self) -> list[int]:
        """The block once it is valid, checked, acknowledged."""
        await self.waits(StatusBit.RESULTS_VALID)
        image = await self.image()
        assert image[-1] == crc16(image[RESULT:-1])
        await self.sets(ControlBit.RESULTS_ACK)
        await self.waits(StatusBit(0), unwanted=StatusBit.RESULTS_VALID)
        await self.sets(ControlBit(0))
        return image


@asynccontextmanager
async def ladder(bench: Bench) -> AsyncIterator[Ladder]:
    """A PLC that is connected."""
    client = AsyncModbusTcpClient(
        "127.0.0.1", port=plc_of(bench).tcp.port, timeout=LIMIT_S, retries=0, reconnect_delay=0
    )
    assert await client.connect()
    try:
        yield Ladder(client)
    finally:
        client.close()
