"""The same registers over a serial line, read and written by pymodbus and by mbpoll."""

import asyncio
import subprocess
import sys
from pathlib import Path

import pytest
from pymodbus.client import AsyncModbusSerialClient

from protocols.plc.codes import ControlBit, StatusBit
from protocols.plc.registers import SIZE
from tests.daemon.cell_under_test import serving, settings_for
from tests.extensions.plc.foreign_clients import needs_mbpoll, output_of
from tests.extensions.plc.plcs import MOVING, Ladder, plc_of, value_of
from tests.support.serial_pair import cable
from tests.support.waiting import LIMIT_S, eventually


def with_line(port: str) -> dict[str, object]:
    return {**MOVING, "serial": {"port": port, "baud": 115200, "parity": "N", "unit": 7}}


@pytest.mark.slow
def test_pymodbus_is_loaded_where_a_line_is_named_only() -> None:
    code = "import sys, extensions.plc.service; sys.exit('pymodbus' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


async def test_a_calibration_over_rtu(tmp_path: Path) -> None:
    async with cable() as (ours, theirs), serving(settings_for(tmp_path, plc=with_line(ours))) as bench:
        rtu = plc_of(bench).rtu
        assert rtu is not None
        await asyncio.wait_for(rtu.opened.wait(), LIMIT_S)
        client = AsyncModbusSerialClient(theirs, baudrate=115200, timeout=LIMIT_S, retries=0, reconnect_delay=0)
        assert await client.connect()
        try:
            plc = Ladder(OfUnit(client, 7))
            await plc.sets(ControlBit(0))
            await plc.waits(StatusBit.READY)
            await plc.triggers(ControlBit.TRIGGER_CALIBRATE)
            image = await plc.result()
            assert value_of(image, "verdict") == 1
            assert value_of(image, "result_number") == value_of(image, "result_id")
            assert value_of(image, "constant_float") == pytest.approx(123.456, abs=1e-5)

            every = plc.client
            assert not (await every.write_coil(5, True)).isError()
            assert (await every.read_coils(0, count=6)).bits[:6] == [False] * 5 + [True]
            assert (await every.read_discrete_inputs(0, count=8)).bits[7]
            assert not (await every.write_coils(0, [False] * 6)).isError()
            assert not (await every.mask_write_register(address=2, and_mask=0, or_mask=9)).isError()
            answer = await every.readwrite_registers(read_address=2, read_count=1, write_address=1, values=[5])
            assert answer.registers == [9]
            assert (await every.write_register(16, 1)).exception_code == 2
            assert (await every.read_holding_registers(SIZE, count=1)).exception_code == 2
            assert value_of(await plc.image(), "heartbeat_echo") == 5
        finally:
            client.close()


class OfUnit:
    """pymodbus's client, speaking to one unit of the line."""

    def __init__(self, client: AsyncModbusSerialClient, unit: int) -> None:
        self._client, self._unit = client, unit

    def __getattr__(self, name: str) -> object:
        method = getattr(self._client, name)
        return lambda *args, **options: method(*args, device_id=self._unit, **options)


@needs_mbpoll
async def test_mbpoll_over_rtu(tmp_path: Path) -> None:
    async with cable() as (ours, theirs), serving(settings_for(tmp_path, plc=with_line(ours))) as bench:
        rtu = plc_of(bench).rtu
        assert rtu is not None
        await asyncio.wait_for(rtu.opened.wait(), LIMIT_S)
        base = ("mbpoll", "-m", "rtu", "-a", "7", "-b", "115200", "-P", "none", "-0", "-1", "-o", "5")
        out = await output_of(*base, "-t", "3:float", "-B", "-r", "24", theirs)
        assert "123.456" in out
        await output_of(*base, "-t", "4", "-r", "2", theirs, "8")
        assert value_of(list(plc_of(bench).gateway._image), "stations_wanted") == 8


async def test_a_line_that_is_not_there_keeps_nobody_from_working(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    async with serving(settings_for(tmp_path, plc=with_line("/dev/does-not-exist"))) as bench:
        assert (await bench.client.get("/health")).status_code == 200
        await eventually(lambda: "cannot be opened" in caplog.text)
        assert caplog.text.count("cannot be opened") == 1


async def test_a_line_that_cannot_do_what_is_asked_is_reported_and_tried_again(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """A pseudo terminal knows no parity."""
    async with cable() as (ours, _):
        settings = settings_for(tmp_path, plc={**with_line(ours), "serial": {"port": ours, "parity": "E"}})
        async with serving(settings) as bench:
            await eventually(lambda: "cannot be opened: Invalid argument" in caplog.text)
            rtu = plc_of(bench).rtu
            assert rtu is not None and rtu._task is not None and not rtu._task.done()
