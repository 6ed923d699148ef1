"""The settling monitor at the mock's EGM: what stands, what rings, what is lost, what is silent."""

import asyncio
import socket
import sys
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress

import numpy as np
import pytest

from calibration.transforms import quaternion_from_rotation
from drivers.errors import DeviceTimeout, DeviceUnreachable
from drivers.robots.abb.egm_vibration import EgmMonitor, vibration_of
from mock_robot.cell import MockCell, Ports
from mock_robot.devices.egm import PERIOD_S, VIBRATION_MM
from mock_robot.truth.truth import CellTruth
from protocols.egm.messages import MessageType, RobotSample, encode
from protocols.egm.protobuf import double_field, integer_field, message_field
from tests.mock_robot.controller_client import AWAY
from tests.support.waiting import eventually

WINDOW_S = 0.5


@asynccontextmanager
async def monitored(robot: str | None = None, **options: float) -> AsyncIterator[tuple[MockCell, EgmMonitor]]:
    """A cell that streams to a monitor of which samples have come."""
    monitor = EgmMonitor("127.0.0.1", 0, robot)
    monitor.start()
    cell = MockCell(CellTruth.from_seed(7), **options)  # type: ignore[arg-type]
    try:
        await cell.start(Ports(devices=None, egm=("127.0.0.1", monitor.port)))
        yield cell, monitor
    finally:
        await cell.close()
        monitor.close()


async def a_window_passes(monitor: EgmMonitor) -> None:
    """Until everything within the window was sent from now on."""
    loop = asyncio.get_running_loop()
    began_s = loop.time()
    await eventually(lambda: loop.time() - began_s > WINDOW_S and monitor.link.connected)


def samples_of(monitor: EgmMonitor) -> list[RobotSample]:
    """The samples within the window; none while a busy machine sends none."""
    with suppress(DeviceTimeout):
        return [arrival.sample for arrival in monitor.arrivals(WINDOW_S)]
    return []


async def test_a_standing_arm_does_not_vibrate_and_is_where_the_controller_says() -> None:
    async with monitored() as (cell, monitor):
        await a_window_passes(monitor)
        await eventually(lambda: len(samples_of(monitor)) > 0.3 * WINDOW_S / PERIOD_S)
        vibration = vibration_of(samples_of(monitor))
        assert vibration.translation_mm == 0.0
        assert vibration.rotation_rad < 1e-7
        newest = monitor.arrivals(WINDOW_S)[-1].sample
        pose = cell.controller.arm.reported_base_T_flange(cell.controller.robot_s(cell.clock()))
        assert newest.position_mm == tuple(np.float32(pose[:3, 3]))
        assert newest.quaternion_wxyz == tuple(np.float32(quaternion_from_rotation(pose[:3, :3])))
        assert newest.motors_on
        assert newest.program_running
        assert cell.egm.corrections == 0


async def test_a_ringing_arm_shows_its_amplitude() -> None:
    async with monitored() as (cell, monitor):
        cell.inject_fault("egm-vibration")
        await a_window_passes(monitor)
        rings = pytest.approx(VIBRATION_MM, rel=0.1)  # about the mean of a window without gaps
        await eventually(lambda: bool(seen := samples_of(monitor)) and vibration_of(seen).translation_mm == rings)
        cell.clear_faults()
        await a_window_passes(monitor)
        await eventually(lambda: bool(seen := samples_of(monitor)) and vibration_of(seen).translation_mm == 0.0)


async def test_a_moving_arm_is_seen_to_move() -> None:
    async with monitored(time_scale=1.0) as (cell, monitor):
        await a_window_passes(monitor)
        cell.controller.arm.depart(AWAY, 50.0, False, cell.controller.robot_s(cell.clock()))
        await eventually(lambda: bool(seen := samples_of(monitor)) and vibration_of(seen).translation_mm > 1.0)


async def test_lost_packets_are_counted_and_garbage_is_no_sample() -> None:
    async with monitored() as (cell, monitor):
        cell.inject_fault("egm-loss")
        await a_window_passes(monitor)
        await eventually(lambda: len(samples_of(monitor)) > 0.3 * WINDOW_S / PERIOD_S)
        vibration = vibration_of(samples_of(monitor))
        assert vibration.lost == pytest.approx(0.25 * vibration.samples, abs=3)
        cell.clear_faults()
        cell.inject_fault("egm-garbage")
        await eventually(lambda: monitor.strangers > 5)
        await eventually(lambda: not monitor.link.connected)


async def test_a_silent_controller_is_reported_with_what_to_do() -> None:
    async with monitored() as (cell, monitor):
        await a_window_passes(monitor)
        cell.inject_fault("egm-silent")
        await eventually(lambda: not monitor.link.connected)
        assert "EGMStreamStart" in monitor.link.detail
        with pytest.raises(DeviceTimeout, match="EGMStreamStart"):
            monitor.vibration(0.1)


async def test_who_waits_for_a_packet_does_not_wait_for_python_to_change_threads() -> None:
    before_s = sys.getswitchinterval()
    try:
        sys.setswitchinterval(5e-3)
        async with monitored() as (_, monitor):
            await a_window_passes(monitor)
            assert sys.getswitchinterval() < 1e-3
    finally:
        sys.setswitchinterval(before_s)


async def test_only_the_named_controller_is_listened_to() -> None:
    async with monitored("192.0.2.1") as (_, monitor):
        await eventually(lambda: monitor.strangers > 5)
        assert not monitor.link.connected
        assert "packets from 127.0.0.1, expected 192.0.2.1" in monitor.link.detail


PLACE, TURN = (500.0, 0.0, 700.0), (0.0, 1.0, 0.0, 0.0)
NONE = "whose pose is none"


def a_packet(number: int, place: tuple[float, ...] = PLACE, turn: tuple[float, ...] = TURN) -> bytes:
    return encode(RobotSample(number, 4 * number, (0.0,) * 6, place, turn))  # type: ignore[arg-type]


def joints_alone(number: int) -> bytes:
    joints = message_field(1, [double_field(1, 0.0)] * 6)
    header = (integer_field(1, number), integer_field(2, 4 * number), integer_field(3, MessageType.DATA))
    return message_field(1, header) + message_field(2, [joints])


@pytest.mark.parametrize(
    ("packet", "why"),
    [
        (lambda number: a_packet(number, place=(float("nan"), 0.0, 700.0)), NONE),
        (lambda number: a_packet(number, place=(float("inf"), 0.0, 700.0)), NONE),
        (lambda number: a_packet(number, turn=(0.0, 0.0, 0.0, 0.0)), NONE),
        (lambda number: a_packet(number, turn=(float("nan"), 1.0, 0.0, 0.0)), NONE),
        (joints_alone, "without a Cartesian pose"),
        (lambda number: b"no EGM", "that are no EGM data of a robot"),
    ],
)
async def test_a_packet_without_a_pose_is_no_sample_and_its_sender_is_named(
    packet: Callable[[int], bytes], why: str
) -> None:
    monitor = EgmMonitor("127.0.0.1", 0)
    monitor.start()
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            for number in range(1, 9):
                sender.sendto(packet(number), ("127.0.0.1", monitor.port))
        await eventually(lambda: monitor.strangers == 8)
        with pytest.raises(DeviceTimeout, match=f"8 packets from 127.0.0.1 {why}"):
            monitor.arrivals(5.0)
    finally:
        monitor.close()


def test_a_taken_port_is_reported() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        with pytest.raises(DeviceUnreachable, match="cannot listen"):
            EgmMonitor("127.0.0.1", taken.getsockname()[1]).start()


@pytest.mark.parametrize("turn_deg", [0.001, 0.1, 10.0])
def test_a_rotation_is_measured_from_the_mean_also_across_a_change_of_sign(turn_deg: float) -> None:
    half = np.radians(turn_deg) / 2
    one, other = (np.cos(half), np.sin(half), 0.0, 0.0), (-np.cos(half), np.sin(half), 0.0, 0.0)
    samples = [
        RobotSample(number, 0, (), (float(number % 2), 0.0, 0.0), quaternion)
        for number, quaternion in enumerate((one, other) * 3)
    ]
    vibration = vibration_of(samples)
    assert np.degrees(vibration.rotation_rad) == pytest.approx(turn_deg, rel=1e-6)
    assert vibration.translation_mm == 0.5
    assert vibration.lost == 0
