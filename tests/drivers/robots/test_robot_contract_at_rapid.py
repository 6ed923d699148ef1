"""What every robot driver does, against the RAPID that is shipped: over TCP, and over a pty."""

import asyncio
import dataclasses
import time
from itertools import product

import numpy as np
import pytest
import pytest_asyncio

from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm import Configuration
from drivers.errors import DeviceUnreachable, GarbledAnswer, MoveFailed, MoveRefused
from drivers.interfaces import MoveGoal, Robot
from drivers.robots.abb.cb_robot import CbRobot
from drivers.robots.abb.robtarget import UNUSED_AXIS
from drivers.transports.serial_line import SerialTransport
from drivers.transports.tcp import TcpTransport
from protocols.cb.codes import Command
from tests.mock_robot.controller_client import AWAY
from tests.mock_robot.running_cell import running_cell
from tests.support.waiting import LIMIT_S, eventually

ARM = find_arm("IRB 1600-6/1.45")
GOAL = MoveGoal(ARM.forward(AWAY), Configuration(*ARM.configuration(AWAY)), speed_mm_s=250.0)
TIME_SCALE = 10.0


@pytest_asyncio.fixture(params=["tcp", "pty"], loop_scope="function")
async def cell(request):
    """A driver connected to the RAPID: (robot, what the client sees)."""
    serial = request.param == "pty"
    async with running_cell(time_scale=TIME_SCALE, serial=serial, devices=False, program="rapid") as running:
        wire = running.announcement
        robot = CbRobot(SerialTransport(wire.serial_path) if serial else TcpTransport(wire.robot_host, wire.robot_port))
        robot.start()
        await robot.wait_for_link(LIMIT_S)
        yield robot, running
        await robot.close()


def joints_now(running):
    controller = running.controller
    return controller.arm.joints_at(controller.robot_s(running.cell.clock()))


async def test_it_is_a_robot(cell):
    robot: Robot = cell[0]
    assert robot.link.connected
    assert f"session {cell[1].controller.session}" in robot.link.detail


async def test_a_pose_and_the_axes_are_the_arms_in_tool0_and_wobj0(cell):
    robot, running = cell
    before_s = time.monotonic()
    reading = await robot.read_pose()
    np.testing.assert_allclose(reading.base_T_flange, ARM.forward(joints_now(running)), atol=1e-3)
    assert reading.posture == Configuration(*ARM.configuration(joints_now(running)))
    assert reading.external_axes == (UNUSED_AXIS,) * 6
    assert reading.still
    assert before_s <= reading.taken_at_s <= time.monotonic()
    np.testing.assert_allclose(await robot.read_joints(), joints_now(running), atol=1e-6)


async def test_a_robot_is_disarmed_until_somebody_arms_it(cell):
    robot, running = cell
    with pytest.raises(MoveRefused, match="arm it") as refused:
        await robot.move_to(GOAL)
    assert refused.value.status == "NOT_ARMED"
    await robot.set_armed(True)
    status = await robot.read_status()
    assert (status.motors_on, status.automatic, status.emergency_stop) == (True, True, False)
    assert (status.moving, status.in_position, status.armed) == (False, True, True)
    await robot.set_armed(False)
    assert not (await robot.read_status()).armed
    assert running.commanded_moves == 0


@pytest.mark.parametrize("path", ["joint", "linear"])
async def test_a_move_returns_when_the_arm_stands_there(cell, path):
    robot, running = cell
    await robot.set_armed(True)
    await robot.move_to(dataclasses.replace(GOAL, path=path))
    assert not running.moving
    np.testing.assert_allclose(joints_now(running), AWAY, atol=1e-5)
    assert (await robot.read_pose()).still
    assert running.commanded_moves == 1


async def test_a_cancelled_move_stops_the_arm(cell):
    robot, running = cell
    await robot.set_armed(True)
    moving = asyncio.create_task(robot.move_to(dataclasses.replace(GOAL, speed_mm_s=50.0)))
    await eventually(lambda: running.moving)
    moving.cancel()
    with pytest.raises(asyncio.CancelledError):
        await moving
    await eventually(lambda: not running.moving)
    assert np.abs(joints_now(running) - AWAY).max() > 0.01


async def test_a_stop_overtakes_and_the_move_fails(cell):
    robot, running = cell
    await robot.set_armed(True)
    moving = asyncio.create_task(robot.move_to(dataclasses.replace(GOAL, speed_mm_s=50.0)))
    await eventually(lambda: running.moving)
    await asyncio.gather(robot.stop_and_disarm(), robot.stop_and_disarm())
    with pytest.raises(MoveFailed) as failed:
        await moving
    assert failed.value.status == "ABORTED"
    await eventually(lambda: not running.moving)
    assert np.abs(joints_now(running) - AWAY).max() > 0.01


async def test_many_ask_at_once_and_each_gets_its_own_answer(cell):
    robot, running = cell
    await robot.set_armed(True)
    answers = await asyncio.gather(
        robot.move_to(GOAL), *(robot.read_pose() for _ in range(5)), robot.read_joints(), robot.read_status()
    )
    assert all(reading.external_axes == (UNUSED_AXIS,) * 6 for reading in answers[1:6])
    assert answers[6].shape == (6,)
    assert running.commanded_moves == 1


@pytest.mark.parametrize("fault", ["link-split", "link-delay", "link-duplicate", "link-request-duplicate"])
async def test_a_bad_but_honest_link_loses_nothing_and_moves_once(cell, fault):
    robot, running = cell
    await robot.set_armed(True)
    running.inject_fault(fault)
    await robot.move_to(GOAL)
    assert robot.link.connected
    assert (running.commanded_moves, running.controller.arm.departures) == (1, 1)


SPOILT = ["link-reply-lost", "serial-half-frame", "serial-doubled-byte", "serial-break"]


@pytest.mark.parametrize(("cell", "fault"), [("tcp", "link-reply-lost"), *product(["pty"], SPOILT)], indirect=["cell"])
async def test_a_lost_or_spoilt_answer_to_a_move_is_asked_for_again_and_the_arm_departs_once(cell, fault):
    robot, running = cell
    await robot.set_armed(True)
    running.inject_fault(fault, only=Command.MOVE)
    await robot.move_to(GOAL)
    assert (running.commanded_moves, running.controller.arm.departures) == (1, 1)


async def test_a_pose_that_is_none_is_refused_and_the_link_stays(cell):
    robot, running = cell
    running.inject_fault("robot-nan-pose")
    with pytest.raises(GarbledAnswer, match="a number that is none"):
        await robot.read_pose()
    assert robot.link.connected


@pytest.mark.slow
async def test_closing_says_bye_disarms_and_stops(cell):
    robot, running = cell
    await robot.set_armed(True)
    await robot.close()
    await eventually(lambda: not running.controller.armed)
    with pytest.raises(DeviceUnreachable, match="closed"):
        await robot.read_pose()
