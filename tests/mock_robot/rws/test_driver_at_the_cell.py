"""The product's own RWS driver at the mock: found by itself, read, watched, stopped; and what each fault does to it."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import numpy as np
import pytest

from calibration.kinematics.arm import Configuration
from drivers.errors import DeviceError, DeviceUnreachable, GarbledAnswer, LinkLost, MoveRefused, RequestRefused
from drivers.interfaces import MoveGoal, Standstill
from drivers.registry import open_robot
from drivers.robots.abb.cb_robot import CbRobot
from drivers.robots.abb.rws.address import RwsAddress
from drivers.robots.abb.rws.administration import RwsAdministration
from drivers.robots.abb.rws.robot import RwsRobot
from drivers.transports.tcp import TcpTransport
from mock_robot.cabinet.panel import Mode
from mock_robot.rws.sessions import MAX_SESSIONS
from protocols.cb.codes import Command
from tests.mock_robot.controller_client import AWAY
from tests.mock_robot.rws_cell import RwsCell, rws_cell
from tests.support.waiting import LIMIT_S, eventually, quick_timing

pytestmark = pytest.mark.slow

VERSIONS = pytest.mark.parametrize("version", [1, 2])


def administration_of(cell: RwsCell, version: int) -> RwsAdministration:
    return RwsAdministration(RwsAddress.parse(cell.rws(version)), quick_timing())


@asynccontextmanager
async def robot_at(cell: RwsCell, version: int, options: str = "") -> AsyncIterator[RwsRobot]:
    robot = open_robot(cell.rws(version) + options, quick_timing())
    assert isinstance(robot, RwsRobot)
    try:
        await robot.wait_for_link(LIMIT_S)
        yield robot
    finally:
        await robot.close()


@VERSIONS
async def test_it_finds_the_version_by_itself_and_reads_what_the_cb_link_reads(version: int) -> None:
    async with rws_cell() as cell, robot_at(cell, version) as robot:
        assert f"RWS {version}.0: motoron, AUTO, RAPID running" in robot.link.detail
        other = CbRobot(TcpTransport(*cell.robot))
        other.start()
        try:
            await other.wait_for_link(LIMIT_S)
            told, here = await other.read_pose(), await robot.read_pose()
            assert np.array_equal(told.base_T_flange[:3, 3], np.float32(here.base_T_flange[:3, 3]))
            assert np.allclose(told.base_T_flange, here.base_T_flange, rtol=0, atol=1e-6)
            assert told.posture == here.posture
            assert told.external_axes == here.external_axes
            assert np.allclose(await other.read_joints(), await robot.read_joints(), rtol=0, atol=1e-8)
            assert here.still
            status = await robot.read_status()
            assert status.motors_on
            assert not (status.armed or status.moving or status.emergency_stop)
        finally:
            await other.close()


@VERSIONS
async def test_the_pendants_speed_ratio_is_read_and_reported(version: int) -> None:
    async with rws_cell() as cell, robot_at(cell, version) as robot:
        assert (await robot.read_state()).speed_ratio == 100.0
        assert not (await robot.read_status()).speed_limited
        cell.controller.panel.speed_override = 0.4
        state = await robot.read_state()
        assert (state.speed_ratio, str(state)) == (40.0, "motoron, AUTO, RAPID running, speed 40 %")
        assert (await robot.read_status()).speed_limited


@VERSIONS
async def test_a_moving_arm_is_not_still(version: int) -> None:
    async with rws_cell(time_scale=1.0) as cell, robot_at(cell, version) as robot:
        arm, now_s = cell.controller.arm, cell.cell.clock()
        arm.depart(AWAY, 100.0, False, cell.controller.robot_s(now_s))
        assert not (await robot.read_pose()).still
        status = await robot.read_status()
        assert status.moving
        assert not status.in_position


@VERSIONS
async def test_it_asks_for_tool0_and_wobj0_whatever_is_selected(version: int) -> None:
    async with rws_cell() as cell, robot_at(cell, version) as robot:
        before = await robot.read_pose()
        cell.cell.inject_fault("rws-other-tool")
        assert np.array_equal((await robot.read_pose()).base_T_flange, before.base_T_flange)


@VERSIONS
async def test_nothing_moves_over_rws_and_the_refusal_says_what_to_do(version: int) -> None:
    async with rws_cell() as cell, robot_at(cell, version) as robot:
        assert not robot.capabilities.moves
        goal = MoveGoal(np.eye(4), Configuration(0, 0, 0, 0))
        with pytest.raises(MoveRefused, match="--manual") as refused:
            await robot.move_to(goal)
        assert refused.value.status == "READ_ONLY"
        with pytest.raises(RequestRefused, match="tcp://"):
            await robot.set_armed(True)
        await robot.set_armed(False)
        assert cell.controller.arm.departures == 0


@VERSIONS
async def test_stop_ends_the_program_and_the_move(version: int) -> None:
    async with rws_cell(time_scale=1.0) as cell, robot_at(cell, version) as robot:
        cell.controller.arm.depart(AWAY, 20.0, False, cell.controller.robot_s(cell.cell.clock()))
        await robot.stop_and_disarm()
        assert not cell.controller.panel.program_running
        await eventually(
            lambda: not cell.cell.controller.arm.is_moving_at(cell.cell.controller.robot_s(cell.cell.clock()))
        )
        assert (await robot.read_event_log())[0].code == 10005


@VERSIONS
async def test_a_standstill_is_confirmed_once_the_program_is_stopped(version: int) -> None:
    async with rws_cell() as cell, robot_at(cell, version) as robot:
        assert not (await robot.read_standstill()).standing
        await robot.stop_and_disarm()
        assert await robot.read_standstill() == Standstill(standing=True, disarmed=True)


@VERSIONS
async def test_a_stop_goes_before_a_hundred_readers(version: int) -> None:
    async with rws_cell() as cell, robot_at(cell, version) as robot:
        readers = [asyncio.create_task(robot.read_joints()) for _ in range(100)]
        await asyncio.sleep(0)
        await robot.stop_and_disarm()
        assert not cell.controller.panel.program_running
        assert (await robot.read_standstill()).standing
        assert sum(reader.done() for reader in readers) < len(readers)
        for reader in readers:
            reader.cancel()
        await asyncio.gather(*readers, return_exceptions=True)
        await robot.read_joints()


async def test_stop_works_before_anything_was_asked() -> None:
    async with rws_cell() as cell:
        robot = RwsRobot(RwsAddress.parse(cell.rws(2)), quick_timing())
        try:
            await robot.stop_and_disarm()
            assert not cell.controller.panel.program_running
        finally:
            await robot.close()


@VERSIONS
async def test_the_panel_is_reported_by_the_controller(version: int) -> None:
    async with rws_cell() as cell, robot_at(cell, version) as robot:
        cell.controller.press_emergency_stop(True, cell.cell.clock())
        assert (await robot.read_status()).emergency_stop
        await eventually(lambda: "emergencystop" in robot.link.detail)
        cell.controller.switch_mode(Mode.MANR, cell.cell.clock())
        await eventually(lambda: "MANR" in robot.link.detail)


@VERSIONS
async def test_files_are_copied_without_mastership_in_every_mode(version: int) -> None:
    text = b"MODULE CELL_shared(SYSMODULE)\r\nENDMODULE\r\n"
    async with rws_cell() as cell, administration_of(cell, version) as controller:
        cell.cell.inject_fault("rws-mastership-held")
        cell.controller.switch_mode(Mode.MANR, cell.cell.clock())
        await controller.make_folder("a/b")
        await controller.write_file("a/b/CELL_shared.sys", text)
        assert cell.world.volumes.folders == {"HOME/a", "HOME/a/b"}
        assert cell.world.volumes.files.pop("HOME/a/b/CELL_shared.sys") == text
        cell.controller.switch_mode(Mode.AUTO, cell.cell.clock())
        with pytest.raises(RequestRefused) as refused:
            async with controller.hold_mastership("cfg"):
                pass
        assert refused.value.status == "MASTERSHIP_HELD"


@VERSIONS
async def test_reconnects_and_a_restart_leave_one_session(version: int) -> None:
    async with rws_cell() as cell:
        sessions = (cell.cell.rws.first if version == 1 else cell.cell.rws.second).sessions
        for _ in range(MAX_SESSIONS - 3):
            sessions.open("another client", cell.cell.clock())
        for _ in range(6):
            robot = RwsRobot(RwsAddress.parse(cell.rws(version) + f"?version={version}"), quick_timing())
            await robot.stop_and_disarm()
            await robot.close()
        assert sessions.count == MAX_SESSIONS - 3
        async with robot_at(cell, version) as robot:
            cell.cell.inject_fault("link-restart")
            await robot.wait_for_link(LIMIT_S)
            await eventually(lambda: robot.link.connected and sessions.count == 1)
            await robot.read_pose()


@VERSIONS
@pytest.mark.parametrize(
    ("fault", "kind", "words"),
    [
        ("rws-401", RequestRefused, "user or password is refused"),
        ("rws-406", RequestRefused, "media type"),
        ("rws-503", DeviceUnreachable, "70 sessions are taken"),
        ("rws-sessions-exhausted", DeviceUnreachable, "70 sessions are taken"),
        ("rws-garbage", GarbledAnswer, "no answer of RWS"),
    ],
)
async def test_each_fault_has_its_error_and_is_over_when_it_is_over(
    version: int, fault: str, kind: type[DeviceError], words: str
) -> None:
    async with rws_cell() as cell, robot_at(cell, version, f"?version={version}") as robot:
        cell.cell.inject_fault(fault)
        with pytest.raises(DeviceError) as refused:
            await robot.read_pose()
        assert isinstance(refused.value, kind), refused.value
        assert words in str(refused.value)
        await eventually(lambda: not robot.link.connected and words in robot.link.detail)
        cell.cell.clear_faults()
        await robot.wait_for_link(LIMIT_S)
        assert (await robot.read_pose()).still


@VERSIONS
async def test_a_controller_that_is_busy_twice_is_asked_again(version: int) -> None:
    async with rws_cell() as cell, robot_at(cell, version, f"?version={version}") as robot:
        cell.cell.inject_fault("rws-503", strikes=2)
        assert (await robot.read_pose()).still
        assert robot.link.connected


@VERSIONS
async def test_a_fault_of_which_no_version_is_known_is_reported_in_the_controllers_words(version: int) -> None:
    async with rws_cell() as cell:
        cell.cell.inject_fault("rws-503")
        robot = RwsRobot(RwsAddress.parse(cell.rws(version)), quick_timing())
        with pytest.raises(DeviceUnreachable, match="503"):
            await robot.stop_and_disarm()
        await robot.close()


async def test_nobody_there_is_reported_for_both_versions_and_a_wrong_password_is_tried_once() -> None:
    robot = RwsRobot(RwsAddress.parse("rws://127.0.0.1:9"), quick_timing())
    with pytest.raises(DeviceUnreachable, match=r"HTTPS: nobody answers.*HTTP: nobody answers"):
        await robot.stop_and_disarm()
    await robot.close()
    async with rws_cell() as cell:
        robot = RwsRobot(RwsAddress.parse(cell.rws(2).replace("rws://", "rws://Admin:guess@")), quick_timing())
        with pytest.raises(RequestRefused, match="user or password") as refused:
            await robot.stop_and_disarm()
        assert "guess" not in str(refused.value)
        await robot.close()


async def test_robotware_8_has_no_mastership_and_the_refusal_says_so() -> None:
    async with rws_cell() as cell, administration_of(cell, 2) as controller:
        cell.cell.inject_fault("rws-410")
        with pytest.raises(RequestRefused, match="no mastership any more") as refused:
            async with controller.hold_mastership("cfg"):
                pass
        assert refused.value.status == "GONE"


async def test_a_late_answer_is_waited_for() -> None:
    async with rws_cell() as cell, robot_at(cell, 2) as robot:
        cell.cell.inject_fault("rws-slow")
        assert (await robot.read_joints()).shape == (6,)


async def test_a_certificate_that_is_given_is_the_only_one_that_is_trusted(tmp_path) -> None:
    from mock_robot.rws.station import write_self_signed

    certificate, _ = write_self_signed(tmp_path, "127.0.0.1")
    async with rws_cell() as cell:
        robot = RwsRobot(RwsAddress.parse(f"{cell.rws(2)}?version=2&certificate={certificate}"), quick_timing())
        with pytest.raises(DeviceUnreachable, match="CERTIFICATE_VERIFY_FAILED"):
            await robot.stop_and_disarm()
        await robot.close()


@VERSIONS
async def test_the_second_way_stops_a_move_when_the_cb_link_breaks(version: int) -> None:
    async with rws_cell(time_scale=1.0) as cell:
        host, port = cell.robot
        robot = open_robot(f"tcp://{host}:{port}", stop_address=cell.rws(version))
        try:
            await eventually(lambda: robot.link.connected and robot.link.detail.endswith("way to stop: there"))
            await robot.set_armed(True)
            cell.cell.inject_fault("link-reset", only=Command.STATUS, after_moves=1)
            arm = cell.controller.arm.arm
            goal = MoveGoal(arm.forward(AWAY), Configuration(*arm.configuration(AWAY)), speed_mm_s=50.0)
            with pytest.raises(LinkLost):
                await robot.move_to(goal)
            await eventually(
                lambda: not cell.cell.controller.arm.is_moving_at(cell.cell.controller.robot_s(cell.cell.clock()))
            )
            assert not cell.controller.panel.program_running
        finally:
            await robot.close()
