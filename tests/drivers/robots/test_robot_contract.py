"""What every robot driver does, over TCP, over a pty and over a socket:// serial URL alike."""

import asyncio
import dataclasses
import time

import numpy as np
import pytest
import pytest_asyncio

from calibration.kinematics.arm import Configuration
from drivers.errors import DeviceUnreachable, GarbledAnswer, MoveFailed, MoveRefused, RequestRefused
from drivers.interfaces import MoveGoal, Robot
from drivers.robots.abb.cb_robot import CbRobot
from drivers.robots.abb.robtarget import UNUSED_AXIS
from drivers.transports.serial_line import SerialTransport
from drivers.transports.tcp import TcpTransport
from protocols.cb.codes import MoveKind, Status
from protocols.cb.messages import Bye, ErrorText, GetPose, GetStatus, Move, Stop
from tests.drivers.robots.fake_controller import BASE_T_FLANGE, STANDING, FakeArm, FakeController, PtyCell, TcpCell
from tests.support.waiting import LIMIT_S, eventually

GOAL = MoveGoal(BASE_T_FLANGE, Configuration(0, -1, 0, 1), speed_mm_s=80.0)


@pytest_asyncio.fixture(params=["tcp", "pty", "socket url"], loop_scope="function")
async def cell(request):
    """A driver connected to a fake controller: (robot, controller)."""
    controller = FakeController(resynchronise=request.param != "tcp")
    if request.param == "pty":
        async with PtyCell(controller) as pty:
            async for pair in _connected(SerialTransport(pty.path), controller):
                yield pair
    else:
        async with TcpCell(controller) as tcp:
            address = f"socket://127.0.0.1:{tcp.port}"
            transport = TcpTransport("127.0.0.1", tcp.port) if request.param == "tcp" else SerialTransport(address)
            async for pair in _connected(transport, controller):
                yield pair


async def _connected(transport, controller):
    robot = CbRobot(transport)
    robot.start()
    await robot.wait_for_link(LIMIT_S)
    yield robot, controller
    await robot.close()


async def test_it_is_a_robot(cell):
    robot: Robot = cell[0]
    assert robot.link.connected
    assert robot.capabilities.moves
    assert "session 7" in robot.link.detail


async def test_a_pose_is_read_in_tool0_and_wobj0(cell):
    robot, controller = cell
    before_s = time.monotonic()
    reading = await robot.read_pose()
    np.testing.assert_allclose(reading.base_T_flange, BASE_T_FLANGE, atol=1e-9)
    assert reading.posture == Configuration(0, -1, 0, 1)
    assert reading.external_axes == (UNUSED_AXIS,) * 6
    assert reading.still
    assert before_s <= reading.taken_at_s <= time.monotonic()
    assert controller.arm.heard[-1] == GetPose(0)


async def test_axes_are_read_in_radians(cell):
    np.testing.assert_allclose(await cell[0].read_joints(), np.radians([10, -20, 30, 0, 90, -180]))


async def test_a_status_is_what_the_flags_say(cell):
    status = await cell[0].read_status()
    assert (status.motors_on, status.automatic, status.emergency_stop) == (True, True, False)
    assert (status.moving, status.in_position, status.armed) == (False, True, False)


async def test_a_robot_is_disarmed_until_somebody_arms_it(cell):
    robot, controller = cell
    with pytest.raises(MoveRefused, match="arm it") as refused:
        await robot.move_to(GOAL)
    assert refused.value.status == "NOT_ARMED"
    await robot.set_armed(True)
    assert (await robot.read_status()).armed
    await robot.set_armed(False)
    assert not (await robot.read_status()).armed
    assert controller.arm.moves == []


async def test_a_move_returns_when_the_arm_stands_there(cell):
    robot, controller = cell
    await robot.set_armed(True)
    await robot.move_to(GOAL)
    (move,) = controller.arm.moves
    assert controller.arm.finished[1] is Status.OK
    assert controller.arm.count(GetStatus) >= 2
    assert move == Move(STANDING.position_mm, (0.5, 0.5, -0.5, 0.5), (0, -1, 0, 1), (8999999488.0,) * 6, 80, 1)


async def test_a_linear_move_is_asked_as_one(cell):
    robot, controller = cell
    await robot.set_armed(True)
    await robot.move_to(MoveGoal(BASE_T_FLANGE, Configuration(0, 0, 0, 0), path="linear"))
    assert controller.arm.moves[0].kind is MoveKind.LINEAR


async def test_every_refusal_says_what_to_do(cell):
    robot, controller = cell
    for status in (status for status in Status if status > Status.VERSION):
        controller.arm.refuses[Move] = status
        with pytest.raises(MoveRefused, match="the move was refused") as refused:
            await robot.move_to(GOAL)
        assert refused.value.status == status.name
        assert len(refused.value.fix) > 10
    assert controller.arm.count(Stop) == 0


async def test_a_move_that_ends_elsewhere_fails(cell):
    robot, controller = cell
    await robot.set_armed(True)
    for status in (Status.ABORTED, Status.MOTION_ERROR, Status.ESTOP):
        controller.arm.ends_with = status
        with pytest.raises(MoveFailed, match="did not reach its goal") as failed:
            await robot.move_to(GOAL)
        assert failed.value.status == status.name


async def test_a_motion_error_is_reported_with_abbs_number_title_and_cause():
    error = ErrorText(50050, "Position outside reach", "axis 3")
    controller = FakeController(FakeArm(error=error, ends_with=Status.MOTION_ERROR))
    async with TcpCell(controller) as tcp:
        async for robot, _ in _connected(TcpTransport("127.0.0.1", tcp.port), controller):
            await robot.set_armed(True)
            with pytest.raises(MoveFailed, match=r"motion error: 50050 Position outside reach \(axis 3\)"):
                await robot.move_to(GOAL)


async def test_a_cancelled_move_stops_the_arm(cell):
    robot, controller = cell
    controller.arm.polls_per_move = None
    await robot.set_armed(True)
    moving = asyncio.create_task(robot.move_to(GOAL))
    await eventually(lambda: controller.arm.running_seq != 0)
    moving.cancel()
    with pytest.raises(asyncio.CancelledError):
        await moving
    assert controller.arm.count(Stop) == 1
    assert controller.arm.finished[1] is Status.ABORTED


async def test_a_stop_overtakes_and_the_move_fails(cell):
    robot, controller = cell
    controller.arm.polls_per_move = None
    await robot.set_armed(True)
    moving = asyncio.create_task(robot.move_to(GOAL))
    await eventually(lambda: controller.arm.running_seq != 0)
    await asyncio.gather(robot.stop_and_disarm(), robot.stop_and_disarm())
    with pytest.raises(MoveFailed) as failed:
        await moving
    assert failed.value.status == "ABORTED"


async def test_many_ask_at_once_and_each_gets_its_own_answer(cell):
    robot, controller = cell
    controller.arm.polls_per_move = 6
    await robot.set_armed(True)
    answers = await asyncio.gather(
        robot.move_to(GOAL), *(robot.read_pose() for _ in range(5)), robot.read_joints(), robot.read_status()
    )
    assert [reading.posture.cfx for reading in answers[1:6]] == [1] * 5
    assert answers[6].shape == (6,)


async def test_every_reply_split_at_every_byte(cell):
    robot, controller = cell
    controller.mangle = lambda request, reply: [reply[k : k + 1] for k in range(len(reply))]
    np.testing.assert_allclose((await robot.read_pose()).base_T_flange, BASE_T_FLANGE, atol=1e-9)
    await robot.set_armed(True)
    await robot.move_to(GOAL)
    assert robot.link.connected


async def test_a_lost_answer_moves_the_arm_once(cell):
    robot, controller = cell
    await robot.set_armed(True)
    controller.mangle = lambda request, reply: [] if isinstance(request, Move) else [reply]
    await robot.move_to(GOAL)
    assert len(controller.arm.moves) == 1
    assert controller.duplicates == 1


async def test_a_pose_that_is_none_is_refused_and_the_link_stays(cell):
    robot, controller = cell
    controller.arm.pose = dataclasses.replace(STANDING, position_mm=(float("nan"), 0, 0))
    with pytest.raises(GarbledAnswer, match="a number that is none"):
        await robot.read_pose()
    assert robot.link.connected


async def test_a_goal_that_is_none_is_not_sent(cell):
    robot, controller = cell
    await robot.set_armed(True)
    with pytest.raises(MoveRefused, match="the goal was not sent"):
        await robot.move_to(dataclasses.replace(GOAL, base_T_flange=BASE_T_FLANGE * np.nan))
    assert controller.arm.moves == []


async def test_a_refused_reading_says_why(cell):
    robot, controller = cell
    controller.arm.refuses[GetPose] = Status.MOTION_ERROR
    with pytest.raises(RequestRefused, match="reading the pose was refused") as refused:
        await robot.read_pose()
    assert refused.value.status == "MOTION_ERROR"


async def test_closing_says_bye_and_ends_everything(cell):
    robot, controller = cell
    await robot.set_armed(True)
    await robot.close()
    assert controller.arm.count(Bye) == 1
    assert not controller.arm.armed
    assert robot.link == type(robot.link)(False, "closed", robot.link.since_s)
    with pytest.raises(DeviceUnreachable, match="closed"):
        await robot.read_pose()
