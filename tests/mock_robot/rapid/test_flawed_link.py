"""The shipped RAPID with a flaw put into its modules, a link task that dies, and a port that cannot be opened."""

import asyncio
import shutil
import socket
from collections.abc import AsyncIterator, Iterable
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import numpy as np
import pytest

from mock_robot.links.wires import CAMERA_LOAD
from mock_robot.rapid.controller import DEPLOYED, RapidController
from protocols.cb import messages as cb
from tests.mock_robot.cb_client import CbClient, over_tcp
from tests.mock_robot.controller_client import AWAY, move_to
from tests.mock_robot.rapid.rapid_client import talking
from tests.support.waiting import LIMIT_S, eventually

pytestmark = pytest.mark.slow

JOINTS_FAIL = (
    "    now := CJointT(\\TaskName:=cell_motion_task);\n    cell_add_float",
    '    Open "none:", cell_line \\Bin;\n    cell_add_float',
)


@asynccontextmanager
async def flawed(tmp_path: Path, *flaws: tuple[str, str]) -> AsyncIterator[tuple[RapidController, CbClient]]:
    """A controller whose link task has a flaw, during a slow move."""
    async with talking(time_scale=1.0) as (healthy, _):
        arm = healthy.controller.arm
    folder = _with_flaws(tmp_path, flaws)
    settings = {"cell_address": "127.0.0.1", "cell_port": 0.0, "cell_flange": CAMERA_LOAD}
    controller = RapidController(arm, 5, settings=settings, folder=folder)
    try:
        await asyncio.to_thread(controller.begin)
        await asyncio.to_thread(controller.await_link)
        async with over_tcp(port_of(controller)) as client:
            await client.is_armed()
            assert await client.asks(move_to(AWAY, 50.0)) == cb.MoveAccepted()
            await eventually(controller.unit.is_moving)
            yield controller, client
    finally:
        await asyncio.to_thread(controller.end)


def logged(controller: RapidController, words: str) -> bool:
    return any(words in entry.text for entry in controller.log)


def port_of(controller: RapidController) -> int:
    assert controller.devices.address is not None
    return controller.devices.address[1]


async def test_when_the_link_task_dies_the_motion_task_ends_its_move_and_production_goes_on(tmp_path: Path) -> None:
    in_handler = ("cell_fault := ERRNO;", "cell_fault := ERRNO / cell_len;")
    async with flawed(tmp_path, JOINTS_FAIL, in_handler) as (controller, client):
        client.write(client.session.request(cb.GetJoints()))
        await eventually(lambda: any(entry.code == 10020 for entry in controller.log))
        await eventually(lambda: not controller.unit.is_moving())
        assert controller.panel.program_running
        assert not controller.armed
        assert np.abs(controller.unit.joints_now() - AWAY).max() > 0.01
        await eventually(lambda: logged(controller, "shows no life"))


async def test_a_move_that_the_link_task_has_given_up_is_ended_by_the_motion_task(tmp_path: Path) -> None:
    async with flawed(tmp_path) as (controller, _):
        controller.memory.preset("cell_moving", False)
        await eventually(lambda: not controller.unit.is_moving())
        assert controller.panel.program_running
        assert not controller.armed
        assert np.abs(controller.unit.joints_now() - AWAY).max() > 0.01
        await eventually(lambda: logged(controller, "the move is ended"))


async def test_an_unforeseen_error_stops_the_arm_and_the_link_begins_anew(tmp_path: Path) -> None:
    async with flawed(tmp_path, JOINTS_FAIL) as (controller, client):
        client.write(client.session.request(cb.GetJoints()))
        await eventually(lambda: not controller.unit.is_moving())
        assert not controller.armed
        assert controller.panel.program_running
        assert [entry.code for entry in controller.log] == [80003]
        await eventually(lambda: connects(port_of(controller)))
        async with over_tcp(port_of(controller)) as again:
            await again.is_armed()


async def test_a_link_that_cannot_be_opened_is_tried_again_each_second(tmp_path: Path) -> None:
    async with talking(time_scale=1.0) as (healthy, _):
        arm = healthy.controller.arm
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        settings = {"cell_address": "127.0.0.1", "cell_port": float(other.getsockname()[1])}
        controller = RapidController(arm, 5, settings=settings)
        await asyncio.to_thread(controller.begin)
        try:
            await eventually(lambda: bool(controller.log))
            assert controller.log[0].code == 80003
            other.close()
            await asyncio.to_thread(controller.await_link)
            controller.devices.network = False
            with pytest.raises(ConnectionError):  # refused, or cut when the port is closed a moment later
                async with over_tcp(port_of(controller)) as cut:
                    await cut.hears()
            controller.devices.network = True
            await eventually(lambda: connects(port_of(controller)))
            assert len(controller.log) == 1, "once a minute"
        finally:
            await asyncio.to_thread(controller.end)


def connects(port: int) -> bool:
    with suppress(OSError), socket.create_connection(("127.0.0.1", port), LIMIT_S):
        return True
    return False


def _with_flaws(folder: Path, flaws: Iterable[tuple[str, str]]) -> Path:
    copy = Path(shutil.copytree(DEPLOYED, folder / "rapid"))
    text = (copy / "CELL_comm.mod").read_text("ascii")
    for sound, flaw in flaws:
        assert text.count(sound) == 1
        text = text.replace(sound, flaw)
    (copy / "CELL_comm.mod").write_text(text)
    return copy
