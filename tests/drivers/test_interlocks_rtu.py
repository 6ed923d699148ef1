"""Interlocks over a serial line whose answers come late, in order: none becomes the value of another question."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest
from pymodbus.server import ModbusSerialServer
from pymodbus.simulator import DataType, SimData, SimDevice

from drivers.interlocks import InterlockReading, Interlocks, InterlockSignal
from protocols.modbus.client_framing import RtuFraming
from tests.drivers.rtu_terminal import GATE, PART, UNIT, RtuTerminal, rtu_terminal
from tests.support.serial_pair import cable
from tests.support.waiting import FakeTime, eventually

LIMIT_S = 0.5


@asynccontextmanager
async def interlocks_at(device: RtuTerminal, time: FakeTime, *signals: InterlockSignal) -> AsyncIterator[Interlocks]:
    interlocks = Interlocks(device.address, UNIT, signals, LIMIT_S, time.timing)
    try:
        yield interlocks
    finally:
        await interlocks.close()


async def readings_in_vain(interlocks: Interlocks, device: RtuTerminal, time: FakeTime) -> tuple[InterlockReading, ...]:
    """A reading that is asked for, and gets no answer within its limit."""
    asked = device.asked
    reading = asyncio.create_task(interlocks.readings())
    await eventually(lambda: device.asked > asked)
    await time.advance(LIMIT_S)
    return await reading


def words_of(readings: tuple[InterlockReading, ...]) -> list[str]:
    return ["allows" if reading.allows else reading.why.partition(" (")[0] for reading in readings]


async def test_gate_and_part_are_read() -> None:
    time = FakeTime()
    async with rtu_terminal() as device, interlocks_at(device, time, GATE, PART) as interlocks:
        for _ in range(8):
            assert words_of(await interlocks.readings()) == ["allows", "is 0"]
        device.bank.inputs[0] = False
        device.bank.inputs[1] = True
        assert words_of(await interlocks.readings()) == ["is 0", "allows"]


@pytest.mark.parametrize("readings_before", range(6))
@pytest.mark.parametrize("in_vain", [1, 2, 5])
@pytest.mark.parametrize("inputs", [8, 64])
async def test_late_answers_are_nobodys_values(readings_before: int, in_vain: int, inputs: int) -> None:
    """The gate is closed and the part is absent; the terminal's answers come after the limit, in order."""
    time = FakeTime()
    async with rtu_terminal(inputs) as device, interlocks_at(device, time, GATE, PART) as interlocks:
        for _ in range(readings_before):
            await interlocks.readings()
        device.bank.inputs[:2] = [False, True]
        device.holds = True
        for _ in range(in_vain):
            assert words_of(await readings_in_vain(interlocks, device, time)) == ["cannot be read"] * 2
            await time.advance(LIMIT_S)
        device.bank.inputs[:2] = [True, False]
        device.holds = False
        assert words_of(await interlocks.readings()) == ["allows", "is 0"]
        assert words_of(await interlocks.readings()) == ["allows", "is 0"]


async def test_after_a_late_answer_the_line_must_be_silent() -> None:
    time = FakeTime()
    async with rtu_terminal() as device, interlocks_at(device, time, GATE, PART) as interlocks:
        await interlocks.readings()
        device.holds = True
        await readings_in_vain(interlocks, device, time)
        asked = device.asked
        again = await interlocks.readings()
        assert "waiting until the line was silent for 0.5 s" in again[0].why
        await time.advance(0.4)
        heard = interlocks._line._heard_at_s
        await device.send(1)
        await eventually(lambda: interlocks._line._heard_at_s > heard)
        await time.advance(0.4)
        assert words_of(await interlocks.readings()) == ["cannot be read"] * 2
        assert device.asked == asked
        await time.advance(0.2)
        device.holds = False
        assert words_of(await interlocks.readings()) == ["allows", "is 0"]


async def test_an_answer_that_fits_no_question_is_no_value() -> None:
    time = FakeTime()
    async with rtu_terminal() as device, interlocks_at(device, time, GATE, PART) as interlocks:
        await interlocks.readings()
        device.holds = True
        reading = asyncio.create_task(interlocks.readings())
        await eventually(lambda: bool(device.held))
        device.held.appendleft(RtuFraming(UNIT).encode(b"\x02\x07" + bytes(7)))
        await device.send(1)
        assert "an answer came that fits no question" in (await reading)[0].why


async def test_answers_that_come_twice_are_noticed() -> None:
    time = FakeTime()
    async with rtu_terminal() as device, interlocks_at(device, time, GATE, PART) as interlocks:
        await interlocks.readings()
        device.holds = True
        reading = asyncio.create_task(interlocks.readings())
        await eventually(lambda: bool(device.held))
        twice = device.held[0]
        await device.send(1)
        assert words_of(await reading) == ["allows", "is 0"]
        await device.connection.send(twice)
        device.holds = False
        await eventually(lambda: interlocks._line._doubtful)
        assert words_of(await interlocks.readings()) == ["cannot be read"] * 2
        await time.advance(LIMIT_S)
        assert words_of(await interlocks.readings()) == ["allows", "is 0"]


async def test_who_asks_during_a_reading_shares_the_next_one() -> None:
    time = FakeTime()
    async with rtu_terminal() as device, interlocks_at(device, time, GATE, PART) as interlocks:
        await interlocks.readings()
        asked = device.asked
        device.holds = True
        first = asyncio.create_task(interlocks.readings())
        await eventually(lambda: bool(device.held))
        others = [asyncio.create_task(interlocks.readings()) for _ in range(50)]
        await asyncio.sleep(0)
        device.bank.inputs[:2] = [False, True]
        device.holds = False
        await device.send(1)
        assert words_of(await first) == ["allows", "is 0"]
        for each in await asyncio.gather(*others):
            assert words_of(each) == ["is 0", "allows"]
        assert device.asked - asked == 2


async def test_a_line_that_is_not_there() -> None:
    interlocks = Interlocks("serial:///dev/does-not-exist?parity=N", UNIT, (GATE, PART), LIMIT_S)
    assert "the port cannot be opened" in (await interlocks.readings())[0].why
    await interlocks.close()


async def test_pymodbus_answers_what_is_asked() -> None:
    """A server that nobody here wrote, with sixteen inputs and coils."""
    bits = [SimData(0, values=[True, False] * 8, datatype=DataType.BITS)]
    words = [SimData(0, values=0, count=1, datatype=DataType.REGISTERS)]
    async with cable() as (ours, theirs):
        server = ModbusSerialServer(SimDevice(UNIT, (bits, bits, words, words)), port=theirs, baudrate=115200)
        await server.serve_forever(background=True)
        interlocks = Interlocks(
            f"serial://{ours}?baud=115200&parity=N", UNIT, (GATE, PART, InterlockSignal("lid", "coil", 14)), 5.0
        )
        for _ in range(6):
            assert words_of(await interlocks.readings()) == ["allows", "is 0", "allows"]
        await interlocks.close()
        await server.shutdown()  # type: ignore[no-untyped-call]
