"""A plant whose daemon knows the arm by Robot Web Services and EGM alone."""

import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

from mock_robot.cabinet.panel import Mode
from tests.mock_robot.running_cell import running_cell
from tests.stories.plant import Plant, daemon_for, small_pictures
from tests.support.ports import free_port


@asynccontextmanager
async def by_rws(folder: Path, version: int) -> AsyncIterator[Plant]:
    """A cell in manual mode whose program stands, and a daemon that knows it by its web services and EGM alone."""
    async with running_cell(time_scale=50.0, truth=small_pictures(3)) as cell:
        urls = await cell.cell.rws.start("127.0.0.1", 0, 0)
        host = (urls.first, urls.second)[version - 1].partition("//")[2]
        egm = {"host": "127.0.0.1", "port": free_port(socket.SOCK_DGRAM), "robot": "127.0.0.1"}
        await cell.cell.egm.start("127.0.0.1", egm["port"])
        robot = {"address": f"rws://{host}", "egm": egm, "limit_s": None}
        try:
            async with daemon_for(cell, folder, robot=robot) as story:
                cell.controller.run_program(False, cell.cell.clock())
                cell.controller.switch_mode(Mode.MANR, cell.cell.clock())
                yield story
                assert cell.commanded_moves == 0
                assert cell.cell.egm.corrections == 0
        finally:
            await cell.cell.egm.close()
            await cell.cell.rws.close()
