"""Faults of a CB link over real sockets and ptys: the operator sees the cause, and no move is made twice."""

import asyncio
import contextlib
import termios
import time

import pytest
import serial

from calibration.kinematics.arm import Configuration
from drivers.errors import DeviceUnreachable, GarbledAnswer, LinkLost
from drivers.interfaces import MoveGoal
from drivers.robots.abb.cb_robot import CbRobot
from drivers.transports.serial_line import SerialConnection, SerialTransport
from drivers.transports.tcp import TcpTransport
from protocols.cb.codes import Status
from protocols.cb.controller import ControllerSession
from protocols.cb.frames import Frame
from protocols.cb.messages import GetPose, Move
from tests.drivers.robots.fake_controller import BASE_T_FLANGE, FakeController, PtyCell, TcpCell
from tests.support.waiting import LIMIT_S, eventually, quick_timing

GOAL = MoveGoal(BASE_T_FLANGE, Configuration(0, 0, 0, 0))


@contextlib.asynccontextmanager
async def driver(transport, timing=None):
    robot = CbRobot(transport, timing or quick_timing())
    robot.start()
    try:
        yield robot
    finally:
        await robot.close()


async def test_nobody_listens_until_somebody_does():
    cell = TcpCell(FakeController())
    async with cell:
        pass
    async with driver(TcpTransport("127.0.0.1", cell.port)) as robot:
        await eventually(lambda: "refused" in robot.link.detail)
        with pytest.raises(DeviceUnreachable, match=r"refused.*communication task"):
            await robot.read_pose()
        with pytest.raises(DeviceUnreachable):
            await robot.wait_for_link(0.01)
        async with cell:
            await eventually(lambda: robot.link.connected)
            await robot.read_pose()


async def test_a_host_name_that_is_none():
    async with driver(TcpTransport("no-such-host.invalid", 1)) as robot:
        await eventually(lambda: robot.link.detail != "not connected yet")
        assert not robot.link.connected


async def test_another_service_listens_at_the_port():
    controller = FakeController()
    controller.greeting = b"SSH-2.0-OpenSSH_9.2\r\n"
    async with TcpCell(controller) as cell, driver(TcpTransport("127.0.0.1", cell.port)) as robot:
        await eventually(lambda: "not the CB link" in robot.link.detail)
        assert not robot.link.connected


async def test_garbage_in_the_middle_closes_tcp_and_it_is_dialled_again():
    controller = FakeController()
    async with TcpCell(controller) as cell, driver(TcpTransport("127.0.0.1", cell.port)) as robot:
        await robot.wait_for_link(LIMIT_S)
        controller.mangle = lambda request, reply: [b"\0\0", reply] if isinstance(request, GetPose) else [reply]
        with pytest.raises(GarbledAnswer, match="not the CB link"):
            await robot.read_pose()
        await eventually(lambda: controller.connections == 2 and robot.link.connected)


async def test_garbage_on_a_serial_line_is_skipped():
    controller = FakeController()
    async with PtyCell(controller) as cell, driver(SerialTransport(cell.path)) as robot:
        await robot.wait_for_link(LIMIT_S)
        controller.mangle = lambda request, reply: [b"\x43\x42\x43\0noise", reply, b"\x43"]
        for _ in range(3):
            await robot.read_pose()
        assert controller.connections == 1


async def test_half_a_frame_then_silence_loses_a_tcp_link():
    controller = FakeController()
    async with TcpCell(controller) as cell, driver(TcpTransport("127.0.0.1", cell.port)) as robot:
        await robot.wait_for_link(LIMIT_S)
        controller.mangle = lambda request, reply: [reply[:30]] if isinstance(request, GetPose) else [reply]
        controller.pieces = first_only(controller, GetPose)
        with pytest.raises((LinkLost, GarbledAnswer)):
            await robot.read_pose()
        assert not robot.link.connected


def first_only(controller, kind):
    """Answer a request of this kind once, and never its repetition."""
    pieces = controller.pieces

    def answering(session, data):
        came = pieces(session, data)
        return [] if controller.duplicates and isinstance(controller.arm.heard[-1], kind) else came

    return answering


async def test_half_a_frame_on_a_serial_line_is_asked_again():
    controller = FakeController()
    async with PtyCell(controller) as cell, driver(SerialTransport(cell.path)) as robot:
        await robot.wait_for_link(LIMIT_S)
        controller.mangle = lambda request, reply: [reply[:30]] if isinstance(request, GetPose) else [reply]
        await robot.read_pose()
        assert controller.arm.count(GetPose) == 1
        assert controller.duplicates >= 1
        assert robot.link.connected


async def test_a_bit_flipped_on_the_way_there_is_asked_again():
    controller = FakeController()
    async with PtyCell(controller) as cell, driver(SerialTransport(cell.path)) as robot:
        await robot.wait_for_link(LIMIT_S)
        await robot.set_armed(True)
        pieces, damaged = controller.pieces, []

        def damage_the_first_move(session, data):
            if not damaged and len(data) > 70:
                damaged.append(data)
                data = data[:30] + bytes([data[30] ^ 1]) + data[31:]
            return pieces(session, data)

        controller.pieces = damage_the_first_move
        await robot.move_to(GOAL)
        assert len(damaged) == len(controller.arm.moves) == 1


async def test_a_reset_in_the_middle_of_a_move_ends_it_and_nothing_moves_afterwards():
    controller = FakeController()
    controller.arm.polls_per_move = None
    async with TcpCell(controller) as cell, driver(TcpTransport("127.0.0.1", cell.port)) as robot:
        await robot.wait_for_link(LIMIT_S)
        await robot.set_armed(True)
        moving = asyncio.create_task(robot.move_to(GOAL))
        await eventually(lambda: controller.arm.running_seq != 0)
        cell.cut()
        with pytest.raises(LinkLost):
            await moving
        await eventually(lambda: controller.connections == 2 and robot.link.connected)
        assert "disarmed" in robot.link.detail
        assert not (await robot.read_status()).armed
        assert len(controller.arm.moves) == 1


async def test_an_answer_lost_with_its_connection_is_not_asked_for_by_moving_again():
    controller = FakeController()
    async with TcpCell(controller) as cell, driver(TcpTransport("127.0.0.1", cell.port)) as robot:
        await robot.wait_for_link(LIMIT_S)
        await robot.set_armed(True)
        controller.mangle = lambda request, reply: [b""] if isinstance(request, Move) else [reply]
        with pytest.raises(LinkLost):
            await robot.move_to(GOAL)
        await eventually(lambda: controller.connections == 2 and robot.link.connected)
        assert len(controller.arm.moves) == 1


async def test_a_controller_that_restarts_behind_a_serial_line_ends_the_move():
    controller = FakeController()
    controller.arm.polls_per_move = None
    async with PtyCell(controller) as cell, driver(SerialTransport(cell.path)) as robot:
        await robot.wait_for_link(LIMIT_S)
        assert "in session 7," in robot.link.detail
        await robot.set_armed(True)
        moving = asyncio.create_task(robot.move_to(GOAL))
        await eventually(lambda: controller.arm.running_seq != 0)
        cell.restart()
        with pytest.raises(LinkLost, match="restarted"):
            await moving
        await eventually(lambda: robot.link.connected)
        assert "restarted since the last connection, connected in session 8" in robot.link.detail
        assert len(controller.arm.moves) == 1


async def test_the_second_client_learns_that_it_is_one():
    controller = FakeController()
    controller.new_session = lambda: ControllerSession(resynchronise=False, refuse_with=Status.BUSY)
    async with TcpCell(controller) as cell, driver(TcpTransport("127.0.0.1", cell.port)) as robot:
        await eventually(lambda: "another client is connected" in robot.link.detail)
        assert not robot.link.connected


async def test_a_line_that_echoes_is_no_controller():
    async with driver(SerialTransport("loop://")) as robot:
        await eventually(lambda: "0x02 is no reply" in robot.link.detail)
        assert not robot.link.connected


async def test_two_writers_on_a_slow_line_do_not_mix_their_bytes():
    port = SlowPort()
    connection = SerialConnection("slow", port)
    first = asyncio.create_task(connection.send(b"a" * 20))
    await eventually(lambda: bool(port.written))
    first.cancel()
    await asyncio.gather(first, return_exceptions=True)
    await connection.send(b"b" * 20)
    await connection.close()
    assert bytes(port.written) == b"a" * 20 + b"b" * 20


class SlowPort:
    """A port that takes one byte after the other and never has anything to read."""

    in_waiting = 0

    def __init__(self):
        self.written = bytearray()

    def write(self, data):
        for byte in data:
            self.written.append(byte)
            time.sleep(0.001)

    def read(self, count):
        time.sleep(0.005)
        return b""

    def close(self):
        pass


async def test_a_serial_port_that_is_not_there():
    async with driver(SerialTransport("/dev/ttyNONE7")) as robot:
        await eventually(lambda: "cannot be opened" in robot.link.detail)
        with pytest.raises(DeviceUnreachable, match="dialout"):
            await robot.read_pose()


class BrokenPort(SlowPort):
    """A port whose adapter is gone: the system's own error, which pyserial lets through."""

    def write(self, data):
        raise termios.error(5, "Input/output error")

    def read(self, count):
        raise termios.error(5, "Input/output error")


async def test_a_setting_the_adapter_cannot_do_is_an_unreachable_device(monkeypatch):
    def refuse(*args, **settings):
        raise termios.error(22, "Invalid argument")

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(DeviceUnreachable, match=r"cannot be opened \(Invalid argument\)"):
        await SerialTransport("/dev/ttyUSB0").connect()


async def test_an_adapter_that_breaks_while_it_is_used_is_a_lost_link():
    connection = SerialConnection("broken", BrokenPort())
    with pytest.raises(LinkLost, match=r"broke \(Input/output error\)"):
        await connection.send(b"a")
    with pytest.raises(LinkLost, match=r"broke \(Input/output error\)"):
        await connection.receive()
    await connection.close()


async def test_a_pulled_adapter_is_a_lost_link():
    controller = FakeController()
    async with driver_on_pulled_pty(controller) as robot:
        await eventually(lambda: not robot.link.connected)
        assert "cannot be opened" in robot.link.detail or "broke" in robot.link.detail


@contextlib.asynccontextmanager
async def driver_on_pulled_pty(controller):
    async with contextlib.AsyncExitStack() as stack:
        cell = await stack.enter_async_context(PtyCell(controller))
        robot = CbRobot(SerialTransport(cell.path), quick_timing())
        robot.start()
        await robot.wait_for_link(LIMIT_S)
        await stack.aclose()
        yield robot
        await robot.close()


async def test_an_answer_of_another_shape_is_garbled_and_the_link_stays():
    controller = FakeController()
    async with TcpCell(controller) as cell, driver(TcpTransport("127.0.0.1", cell.port)) as robot:
        await robot.wait_for_link(LIMIT_S)
        short = lambda reply: Frame(0x83, int.from_bytes(reply[4:6], "little"), b"\0" * 60).encode()  # noqa: E731
        controller.mangle = lambda request, reply: [short(reply)] if isinstance(request, GetPose) else [reply]
        with pytest.raises(GarbledAnswer, match="60 bytes instead of 68"):
            await robot.read_pose()
        assert (await robot.read_status()).motors_on
        assert controller.connections == 1
