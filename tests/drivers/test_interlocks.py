"""Gate and part, read over Modbus TCP before each move."""

import asyncio
import socket
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

import pytest

from drivers.errors import AddressNotUnderstood, InterlockRefused
from drivers.interlocked_robot import InterlockedRobot
from drivers.interlocks import Interlocks, InterlockSignal, parse_interlock_address
from tests.daemon.fakes import FakeRobot
from tests.drivers.modbus_terminal import Terminal, terminal
from tests.support.serial_pair import cable
from tests.support.waiting import LIMIT_S

GATE = InterlockSignal("gate closed", "discrete-input", 0)
PART = InterlockSignal("part present", "coil", 3)
DOOR_OPEN = InterlockSignal("door not open", "discrete-input", 1, allows=False)


@asynccontextmanager
async def interlocks_of(
    device: Terminal, *signals: InterlockSignal, limit_s: float = 20.0
) -> AsyncIterator[Interlocks]:
    interlocks = Interlocks(f"tcp://127.0.0.1:{device.port}", 1, signals, limit_s)
    try:
        yield interlocks
    finally:
        await interlocks.close()


def opens_the_gate(device: Terminal) -> None:
    device.inputs[0] = False


def takes_the_part(device: Terminal) -> None:
    device.coils[3] = False


def opens_the_door(device: Terminal) -> None:
    device.inputs[1] = True


async def test_all_well_allows_motion_and_is_read_afresh() -> None:
    async with terminal() as device, interlocks_of(device, GATE, PART, DOOR_OPEN) as interlocks:
        assert all(reading.allows for reading in await interlocks.readings())
        assert all(reading.allows for reading in await interlocks.readings())
        assert device.asked == 4  # inputs and coils, twice


@pytest.mark.parametrize(
    ("what", "name", "value"),
    [(opens_the_gate, "gate closed", 0), (takes_the_part, "part present", 0), (opens_the_door, "door not open", 1)],
)
async def test_the_one_that_does_not_allow_it_is_named(what: Callable[[Terminal], None], name: str, value: int) -> None:
    async with terminal() as device, interlocks_of(device, GATE, PART, DOOR_OPEN) as interlocks:
        what(device)
        robot = FakeRobot()
        guarded = InterlockedRobot(robot, interlocks)
        with pytest.raises(InterlockRefused, match=f"{name} is {value}") as refused:
            await guarded.set_armed(True)
        assert refused.value.interlocks == (name,)
        assert not robot.armed
        await guarded.set_armed(False)
        await guarded.stop_and_disarm()


async def test_one_that_cannot_be_read_forbids_motion() -> None:
    async with terminal() as device, interlocks_of(device, GATE, InterlockSignal("far", "coil", 9)) as interlocks:
        first, second = await interlocks.readings()
        assert first.allows
        assert not second.allows
        assert "coil 9 is refused with exception 2" in second.why


async def test_a_device_that_says_nothing_forbids_motion_in_time_and_is_asked_again() -> None:
    async with terminal() as device, interlocks_of(device, GATE, limit_s=0.2) as interlocks:
        device.mute = True
        assert "no answer in time" in (await interlocks.readings())[0].why
        device.mute = False
        async with asyncio.timeout(LIMIT_S):
            while not (await interlocks.readings())[0].allows:  # a busy machine may be late more than once
                pass


async def test_a_device_that_is_gone_forbids_motion_and_may_come_back() -> None:
    with socket.create_server(("127.0.0.1", 0)) as nobody:
        port = nobody.getsockname()[1]
    interlocks = Interlocks(f"tcp://127.0.0.1:{port}", 1, (GATE, PART), 20.0)
    readings = await interlocks.readings()
    assert [reading.allows for reading in readings] == [False, False]
    assert "nobody answers" in readings[0].why
    async with terminal(port):
        assert all(reading.allows for reading in await interlocks.readings())
        await interlocks.close()


async def test_a_serial_adapter_that_cannot_do_the_parity_does_not_allow_motion() -> None:
    """A pseudo terminal has no parity: pyserial lets termios.error through."""
    async with cable() as (ours, _):
        interlocks = Interlocks(f"serial://{ours}?parity=E", 1, (GATE,), 5.0)
        (reading,) = await interlocks.readings()
        await interlocks.close()
    assert not reading.allows
    assert reading.why.endswith("the port cannot be opened (Invalid argument))")


@pytest.mark.parametrize("address", ["tcp://plc:502", "tcp://10.0.0.1", "serial:///dev/ttyUSB0?baud=9600&parity=N"])
def test_addresses(address: str) -> None:
    parse_interlock_address(address)


@pytest.mark.parametrize(
    "address", ["", "plc", "http://plc", "tcp://", "tcp://plc:99999", "serial://", "serial:///dev/x?baud=fast",
                "serial:///dev/x?speed=1", "tcp://plc/path"],
)  # fmt: skip
def test_addresses_that_are_none(address: str) -> None:
    with pytest.raises(AddressNotUnderstood, match="write tcp://host:502"):
        parse_interlock_address(address)
