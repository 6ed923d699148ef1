"""The product's own driver at the mock cell: what the daemon will meet, over both wires."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import numpy as np
import pytest

from calibration.kinematics.arm import Configuration, UnreachablePoseError
from calibration.transforms import difference, inverse, rotation_from_vector, transform
from drivers.errors import DeviceError, GarbledAnswer, LinkLost, MoveFailed, MoveRefused
from drivers.interfaces import MoveGoal
from drivers.robots.abb.cb_robot import CbRobot
from drivers.transports.serial_line import SerialTransport
from drivers.transports.tcp import TcpTransport
from mock_robot.cell import RobotProgram
from mock_robot.truth.start_posture import target_middle_mm
from mock_robot.truth.truth_sheet import scan_poses_of
from protocols.cb.codes import Command
from tests.mock_robot.controller_client import AWAY, HOME
from tests.mock_robot.running_cell import RunningCell, running_cell
from tests.support.waiting import LIMIT_S, eventually


@asynccontextmanager
async def robot_at(cell: RunningCell, *, serial: bool = False) -> AsyncIterator[CbRobot]:
    wire = cell.announcement
    robot = CbRobot(
        SerialTransport(str(wire.serial_path)) if serial else TcpTransport(wire.robot_host, wire.robot_port)
    )
    robot.start()
    try:
        await robot.wait_for_link(LIMIT_S)
        yield robot
    finally:
        await robot.close()


def goal_at(cell: RunningCell, joints: np.ndarray, **how: float) -> MoveGoal:
    arm = cell.controller.arm.arm
    return MoveGoal(arm.forward(joints), Configuration(*arm.configuration(joints)), speed_mm_s=250.0, **how)  # type: ignore[arg-type]


def views_of_the_target(cell: RunningCell, count: int = 6) -> list[np.ndarray]:
    """Joints from which the camera looks at the target from 600 mm, tilted 25° to all sides."""
    truth, arm = cell.truth, cell.controller.arm.arm
    views = []
    for azimuth in np.linspace(0, 2 * np.pi, count, endpoint=False):
        tilt = rotation_from_vector(np.radians(25) * np.array([np.cos(azimuth), np.sin(azimuth), 0]))
        for roll in np.linspace(0, 2 * np.pi, 24, endpoint=False):
            rotation = truth.base_T_target[:3, :3] @ tilt @ rotation_from_vector([0, 0, roll])
            base_T_camera = transform(rotation, target_middle_mm(truth) - 600.0 * rotation[:, 2])
            try:
                views.append(
                    arm.nearest(base_T_camera @ inverse(truth.flange_T_camera), cell.controller.arm.joints_at(0))
                )
            except UnreachablePoseError:
                continue
            break
    return views


@pytest.mark.parametrize("program", ["rapid", "python"])
@pytest.mark.parametrize("serial", [False, True], ids=["tcp", "serial"])
async def test_it_visits_views_all_around_the_target_and_reads_where_it_stands(
    serial: bool, program: RobotProgram
) -> None:
    async with (
        running_cell(time_scale=50.0, serial=serial, devices=False, program=program) as cell,
        robot_at(cell, serial=serial) as robot,
    ):
        await robot.set_armed(True)
        views = views_of_the_target(cell)
        assert len(views) == 6
        for joints in views:
            goal = goal_at(cell, joints)
            await robot.move_to(goal)
            reading = await robot.read_pose()
            assert reading.still
            shift_mm, turn_rad = difference(reading.base_T_flange, goal.base_T_flange)
            assert shift_mm < 2e-4
            assert turn_rad < 1e-6
            assert reading.posture == goal.posture
        assert cell.commanded_moves == 6


async def test_the_taught_scan_poses_are_reachable_one_after_the_other() -> None:
    async with running_cell(time_scale=100.0, devices=False) as cell, robot_at(cell) as robot:
        await robot.set_armed(True)
        arm, joints = cell.controller.arm.arm, cell.controller.arm.joints_at(0.0)
        for pose in scan_poses_of(cell.truth):
            joints = arm.nearest(pose, joints)
            await robot.move_to(goal_at(cell, joints))
        assert cell.commanded_moves == 8


async def test_an_unreachable_goal_is_refused_by_name() -> None:
    async with running_cell(devices=False) as cell, robot_at(cell) as robot:
        await robot.set_armed(True)
        far = transform(np.diag([1.0, -1.0, -1.0]), [1390.0, 900.0, 300.0])
        with pytest.raises(MoveRefused) as refused:
            await robot.move_to(MoveGoal(far, Configuration(0, 0, 0, 0)))
        assert refused.value.status == "UNREACHABLE"
        assert cell.commanded_moves == 0


async def test_the_emergency_stop_ends_a_move_and_nothing_moves_afterwards() -> None:
    async with running_cell(time_scale=2.0, devices=False) as cell, robot_at(cell) as robot:
        await robot.set_armed(True)
        cell.inject_fault("robot-emergency-stop", after_moves=1)
        with pytest.raises(MoveFailed) as failed:
            await robot.move_to(goal_at(cell, HOME))
        assert failed.value.status == "ESTOP"
        with pytest.raises(MoveRefused):
            await robot.move_to(goal_at(cell, AWAY))
        assert cell.commanded_moves == 1
        assert not cell.moving


@pytest.mark.parametrize("fault", ["link-reset", "link-close", "link-drop-mid-frame", "link-bit-flip", "link-garbage"])
async def test_a_link_lost_in_a_move_fails_it_stops_the_arm_and_disarms(fault: str) -> None:
    async with running_cell(time_scale=1.0, devices=False) as cell, robot_at(cell) as robot:
        await robot.set_armed(True)
        cell.inject_fault(fault, only=Command.STATUS, after_moves=1)
        with pytest.raises((LinkLost, GarbledAnswer)):
            await robot.move_to(goal_at(cell, HOME))
        await eventually(lambda: not cell.controller.armed and not cell.moving)
        await robot.wait_for_link(LIMIT_S)
        assert not (await robot.read_status()).armed
        with pytest.raises(MoveRefused):
            await robot.move_to(goal_at(cell, HOME))
        assert cell.commanded_moves == 1


async def test_a_move_after_a_restart_between_two_requests_ends_as_the_lost_link_that_disarmed_the_arm() -> None:
    async with running_cell(time_scale=50.0, devices=False) as cell, robot_at(cell) as robot:
        await robot.set_armed(True)
        cell.inject_fault("link-restart")
        await eventually(lambda: "restarted since the last connection" in robot.link.detail)
        with pytest.raises(LinkLost):
            await robot.move_to(goal_at(cell, HOME))
        with pytest.raises(MoveRefused):
            await robot.move_to(goal_at(cell, HOME))
        assert cell.commanded_moves == 0


@pytest.mark.parametrize("fault", ["link-split", "link-duplicate", "link-request-duplicate", "link-delay"])
async def test_a_bad_but_honest_link_loses_nothing_and_moves_once(fault: str) -> None:
    async with running_cell(time_scale=50.0, devices=False) as cell, robot_at(cell) as robot:
        await robot.set_armed(True)
        cell.inject_fault(fault)
        await robot.move_to(goal_at(cell, HOME))
        assert cell.controller.arm.departures == 1


async def test_a_lost_answer_to_a_move_is_asked_for_again_and_the_arm_departs_once() -> None:
    async with running_cell(time_scale=50.0, devices=False) as cell, robot_at(cell) as robot:
        await robot.set_armed(True)
        cell.inject_fault("link-reply-lost", only=Command.MOVE)
        await robot.move_to(goal_at(cell, HOME))
        assert cell.controller.arm.departures == 1


@pytest.mark.parametrize("fault", ["robot-nan-pose", "robot-quaternion-not-unit"])
async def test_a_pose_that_is_none_is_an_error_not_a_reading(fault: str) -> None:
    async with running_cell(devices=False) as cell, robot_at(cell) as robot:
        cell.inject_fault(fault)
        with pytest.raises(DeviceError):
            await robot.read_pose()
