"""A serial line that nobody here wrote: socat joins two ptys, one of them the mock's."""

import asyncio
import shutil
from asyncio.subprocess import DEVNULL
from pathlib import Path

import numpy as np
import pytest

from drivers.robots.abb.cb_robot import CbRobot
from drivers.transports.serial_line import SerialTransport
from tests.mock_robot.running_cell import running_cell as cell_with_a_line
from tests.support.waiting import LIMIT_S, eventually


@pytest.mark.skipif(shutil.which("socat") is None, reason="socat is not installed: apt-get install socat")
async def test_the_cb_link_runs_over_a_pair_of_ptys_that_socat_joins(tmp_path: Path) -> None:
    async with cell_with_a_line(serial=True, devices=False) as cell:
        line = tmp_path / "line"
        mocks = f"{cell.announcement.serial_path},raw,echo=0"
        socat = await asyncio.create_subprocess_exec("socat", f"pty,raw,echo=0,link={line}", mocks, stderr=DEVNULL)
        try:
            await eventually(line.exists)
            robot = CbRobot(SerialTransport(str(line)))
            robot.start()
            try:
                await robot.wait_for_link(LIMIT_S)
                reading = await robot.read_pose()
                pose = cell.controller.arm.reported_base_T_flange(cell.controller.robot_s(cell.cell.clock()))
                assert np.array_equal(np.float32(reading.base_T_flange[:3, 3]), np.float32(pose[:3, 3]))
                await robot.set_armed(True)
                assert cell.controller.armed
            finally:
                await robot.close()
        finally:
            socat.terminate()
            await asyncio.wait_for(socat.wait(), LIMIT_S)
