"""One arm, whoever asks: RWS 1.0, RWS 2.0, the CB link and EGM tell the same digits, whichever program runs."""

import asyncio

import httpx
import numpy as np
import pytest

from drivers.robots.abb.cb_robot import CbRobot
from drivers.transports.tcp import TcpTransport
from protocols.egm.messages import decode
from tests.foreign.client_checks import held_by
from tests.mock_robot.controller_client import AWAY
from tests.mock_robot.rws_cell import ACCEPT_2, RwsCell, rws_cell
from tests.support.waiting import LIMIT_S, eventually

PATH = "/rw/motionsystem/mechunits/ROB_1/robtarget?tool=tool0&wobj=wobj0&coordinate=Wobj"


async def told_by_all(cell: RwsCell, robot: CbRobot) -> list[list[str]]:
    """The pose as each tells it, in printed digits."""
    names = list(held_by(cell))
    digest = httpx.DigestAuth("Default User", "robotics")
    async with httpx.AsyncClient(verify=False, trust_env=False, timeout=LIMIT_S) as client:
        first = (await client.get(f"{cell.first}{PATH}&json=1", auth=digest)).json()["_embedded"]["_state"][0]
        answer = await client.get(f"{cell.second}{PATH}", auth=("Admin", "robotics"), headers=ACCEPT_2)
    second = answer.json()["state"][0]
    sample = decode(cell.cell.egm.packet(cell.cell.clock()))
    egm = [f"{number:.9g}" for number in (*sample.position_mm, *sample.quaternion_wxyz)]
    link = [f"{value:.9g}" for value in (await robot.read_pose()).base_T_flange[:3, 3]]
    return [[first[name] for name in names], [second[name] for name in names], egm, [*link, *egm[3:]]]


@pytest.mark.parametrize("program", ["python", "rapid"])
async def test_every_way_gives_the_same_pose_before_and_after_a_move(program: str) -> None:
    async with rws_cell(program=program) as cell:
        robot = CbRobot(TcpTransport(*cell.robot))
        robot.start()
        try:
            await robot.wait_for_link(LIMIT_S)
            before = await told_by_all(cell, robot)
            assert before == [list(held_by(cell).values())] * 4
            arm = cell.controller.arm
            arm.depart(AWAY, 500.0, False, cell.controller.robot_s(cell.cell.clock()))
            await eventually(lambda: arm.is_settled_at(cell.controller.robot_s(cell.cell.clock())))
            await asyncio.sleep(0)
            after = await told_by_all(cell, robot)
            assert after == [list(held_by(cell).values())] * 4
            assert after != before
            assert np.isfinite([float(digits) for digits in after[0]]).all()
        finally:
            await robot.close()
