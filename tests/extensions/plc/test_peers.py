"""Modbus clients that nobody here wrote: Debian's mbpoll, and npm's modbus-serial."""

import json
import os
import re
import shutil
from pathlib import Path

import pytest

from protocols.plc.codes import StatusBit
from tests.daemon.cell_under_test import serving, settings_for
from tests.extensions.plc.foreign_clients import needs_mbpoll, output_of
from tests.extensions.plc.plcs import MOVING, ladder, plc_of, value_of


@needs_mbpoll
async def test_mbpoll_reads_and_writes(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path, plc=MOVING)) as bench, ladder(bench) as plc:
        await plc.waits(StatusBit.ONLINE)
        base = ("mbpoll", "-m", "tcp", "-p", str(plc_of(bench).tcp.port), "-a", "1", "-0", "-1")

        async def read(*options: str) -> list[str]:
            out = await output_of(*base, *options, "127.0.0.1")
            return re.findall(r"^\[\d+\]:\s+(\S+)", out, re.MULTILINE)

        assert await read("-t", "3:float", "-B", "-r", "24") == ["123.456"]
        assert await read("-t", "4:int", "-B", "-r", "26") == ["123456"]
        await output_of(*base, "-t", "4", "-r", "2", "127.0.0.1", "8", "1", "4464")
        assert await read("-t", "4", "-r", "0", "-c", "5") == ["0", "0", "8", "1", "4464"]
        assert value_of(await plc.image(), "part_id") == 70000
        await output_of(*base, "-t", "0", "-r", "5", "127.0.0.1", "1")
        assert await read("-t", "0", "-r", "0", "-c", "6") == ["0", "0", "0", "0", "0", "1"]
        assert (await read("-t", "1", "-r", "0", "-c", "8"))[7] == "1"
        assert len(await read("-t", "3", "-r", "0", "-c", "125")) == 125
        with pytest.raises(AssertionError, match="Illegal data address"):
            await output_of(*base, "-t", "4", "-r", "16", "127.0.0.1", "1")


def modbus_serial() -> str:
    """The folder that holds npm's package; the test is skipped when it is not there."""
    folder = os.environ.get("HANDEYED_NODE_MODULES", "")
    if shutil.which("node") is None or not (Path(folder) / "modbus-serial").is_dir():
        pytest.skip("npm's modbus-serial is not here: npm install modbus-serial, and set HANDEYED_NODE_MODULES")
    return folder


async def test_modbus_serial_reads_and_writes(tmp_path: Path) -> None:
    folder = modbus_serial()
    async with serving(settings_for(tmp_path, plc=MOVING)) as bench, ladder(bench) as plc:
        await plc.waits(StatusBit.ONLINE)
        script = Path(__file__).with_name("modbus_serial.js")
        out = await output_of("node", str(script), str(plc_of(bench).tcp.port), NODE_PATH=folder)
        told = json.loads(out.splitlines()[-1])
        assert told["constant"] == pytest.approx(123.456, abs=1e-5)
        assert told["control"] == [32, 0, 8, 1, 4464]
        assert told["coils"] == [False] * 5 + [True]
        assert told["online"] is True
        assert told["versions"] == [1] * 16
        assert told["refused"] == "2"
