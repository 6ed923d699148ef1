"""deploy/fleet/archive_calibrations.py against a daemon: each applied calibration once, nothing replaced."""

import asyncio
import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

from daemon.model.records import AppliedCalibration
from handeyed import Client
from tests.daemon.calibrations import apply_calibration
from tests.daemon.cell_under_test import Bench

SCRIPT = Path(__file__).resolve().parents[3] / "deploy" / "fleet" / "archive_calibrations.py"


@pytest.fixture
def script() -> ModuleType:
    found = importlib.util.spec_from_file_location("archive_calibrations", SCRIPT)
    assert found is not None and found.loader is not None
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


async def test_each_applied_calibration_is_written_once_and_stays_as_it_is(
    bench: Bench, script: ModuleType, tmp_path: Path
) -> None:
    folder = tmp_path / "press-1"

    async def archive() -> list[str]:
        with Client(bench.url) as daemon:
            written: list[str] = await asyncio.to_thread(script.archive, daemon, folder)
        return written

    for name in ("cal-1", "cal-2"):
        await apply_calibration(bench, name)
    folder.mkdir()
    left = folder / ".cal-1.json.part"
    left.touch(0o444)  # of a machine that stopped; root could write to it
    was = left.stat().st_ino
    await bench.application.store.apply(AppliedCalibration("cal-1", "2026-11-21T10:00:00.000Z", "test"))  # again
    kept_open = left.open()
    assert await archive() == ["cal-1", "cal-2"]
    kept_open.close()
    assert (folder / "cal-1.json").stat().st_ino != was
    assert {file.name: file.stat().st_mode & 0o777 for file in folder.iterdir()} == {
        "cal-1.json": 0o444, "cal-2.json": 0o444
    }  # fmt: skip
    assert json.loads((folder / "cal-1.json").read_bytes()) == (await bench.client.get("/calibrations/cal-1")).json()
    (folder / "cal-1.json").chmod(0o644)
    (folder / "cal-1.json").write_text("kept")
    await apply_calibration(bench, "cal-3")
    assert await archive() == ["cal-3"]
    assert (folder / "cal-1.json").read_text() == "kept"


async def test_the_command_says_what_it_has_written_and_refuses_another_folder(bench: Bench, tmp_path: Path) -> None:
    await apply_calibration(bench, "cal-1")

    async def run(cell: str) -> "subprocess.CompletedProcess[str]":
        command = [sys.executable, str(SCRIPT), cell, bench.url, str(tmp_path / "kept")]
        environment = {**os.environ, "PYTHONPATH": str(SCRIPT.parents[2])}
        return await asyncio.to_thread(
            subprocess.run, command, env=environment, capture_output=True, text=True, check=False
        )

    ran = await run("press-1")
    assert (ran.returncode, ran.stdout) == (0, "press-1/cal-1.json\n"), ran.stderr
    refused = await run("../press-1")
    assert refused.returncode == 1
    assert "no name of a cell" in refused.stderr
