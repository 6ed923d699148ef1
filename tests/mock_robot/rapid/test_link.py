"""The shipped RAPID at its link: what it answers, what it refuses, and when the arm stops. Real sockets, a real pty."""

import struct
import threading
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace

import numpy as np
import pytest

from mock_robot.arm.simulated_arm import plan_motion
from mock_robot.cabinet.panel import Mode
from mock_robot.rapid.controller import RapidController
from protocols.cb import messages as cb
from protocols.cb.codes import Flag, FrameSelector, MoveKind, Status
from protocols.cb.frames import Frame
from protocols.cb.layouts import pack
from tests.mock_robot.cb_client import CbClient, over_serial, over_tcp
from tests.mock_robot.controller_client import ARM, AWAY, HOME, UNUSED, fastest_mm_s, move_to
from tests.mock_robot.rapid.rapid_client import (
    answer_to,
    ends_as,
    joints_now,
    moves_again,
    report_of,
    talking,
)
from tests.mock_robot.running_cell import RunningCell, running_cell
from tests.support.waiting import LIMIT_S, eventually

pytestmark = pytest.mark.slow

WIRES = pytest.mark.parametrize("serial", [False, True], ids=["tcp", "serial"])
GOOD = move_to(AWAY)
NAN = float("nan")


@WIRES
async def test_the_published_bytes_are_with_answers_of_the_rapid(serial: bool) -> None:
    async with running_cell(serial=serial, devices=False, program="rapid") as cell:
        wire = cell.announcement
        async with over_serial(str(wire.serial_path)) if serial else over_tcp(int(wire.robot_port or 0)) as client:
            ping = bytes.fromhex("43 42 01 01 01 00 00 00 00 00 88 0a")
            assert await answer_to(client, ping) == Frame(0x81, 1).encode()
            hello = bytes.fromhex("43 42 01 02 02 00 00 00 08 00 94 c7 01 00 00 00 01 00 00 00")
            welcome = cb.Welcome(1, cb.Capability(255), cell.controller.session, 5, 1024, 6)
            assert await answer_to(client, hello) == Frame(0x82, 2, pack(welcome)).encode()
            pose = await answer_to(client, Frame(3, 3, b"\0\0").encode())
            assert pose[:10] == bytes.fromhex("43 42 01 83 03 00 00 00 44 00")
            assert pose[12 + 36 : 12 + 60] == 6 * bytes.fromhex("46 1c 06 50")
            assert Frame(0x83, 3, pose[12:]).encode() == pose


@WIRES
async def test_pose_joints_and_flags_are_those_of_the_arm(serial: bool) -> None:
    async with talking(serial=serial) as (cell, client):
        assert await client.moves(GOOD) is Status.OK
        pose, joints = await client.asks(cb.GetPose()), await client.asks(cb.GetJoints())
        assert isinstance(pose, cb.Pose)
        assert isinstance(joints, cb.Joints)
        np.testing.assert_allclose(pose.position_mm, ARM.forward(AWAY)[:3, 3], atol=1e-3)
        assert pose.configuration == ARM.configuration(AWAY)
        assert pose.external_axes == (8999999488.0,) * 6
        np.testing.assert_allclose(joints.axes_deg, np.degrees(AWAY), atol=1e-4)
        assert pose.flags == Flag.MOTORS_ON | Flag.AUTO | Flag.IN_POSITION | Flag.ARMED | Flag.TASK_RUNNING
        own = await client.asks(cb.GetPose(FrameSelector.CELL))
        assert isinstance(own, cb.Pose)
        assert replace(own, t_ms=pose.t_ms) == pose, "as shipped, the cell's tool and work object are tool0 and wobj0"
        assert cell.commanded_moves == 1


@pytest.mark.parametrize(
    ("request_", "status"),
    [
        (replace(GOOD, position_mm=(1390.0, 900.0, 300.0)), Status.UNREACHABLE),
        (replace(GOOD, configuration=(*GOOD.configuration[:3], 6)), Status.UNREACHABLE),
        (replace(GOOD, configuration=(3, *GOOD.configuration[1:])), Status.UNREACHABLE),
        (replace(GOOD, position_mm=(900.0, 0.0, -50.0)), Status.OUTSIDE_BOX),
        (replace(GOOD, speed_mm_s=0.0), Status.SPEED),
        (replace(GOOD, speed_mm_s=-5.0), Status.SPEED),
        (replace(GOOD, speed_mm_s=7000.0), Status.SPEED),
        (replace(GOOD, speed_mm_s=NAN), Status.SPEED),
        (replace(GOOD, speed_mm_s=float("inf")), Status.SPEED),
        (replace(GOOD, position_mm=(NAN, 0.0, 0.0)), Status.BAD_FIELD),
        (replace(GOOD, quaternion_wxyz=(NAN, 0.0, 0.0, 1.0)), Status.BAD_FIELD),
        (replace(GOOD, quaternion_wxyz=(0.9, 0.0, 0.0, 0.0)), Status.BAD_FIELD),
        (replace(GOOD, quaternion_wxyz=(0.0, 0.0, 0.0, 0.0)), Status.BAD_FIELD),
        (replace(GOOD, external_axes=(NAN, *UNUSED[1:])), Status.BAD_FIELD),
        (replace(GOOD, position_mm=(3e38, 3e38, 3e38)), Status.OUTSIDE_BOX),
        (replace(GOOD, quaternion_wxyz=(3e38, 3e38, 0.0, 0.0)), Status.BAD_FIELD),
    ],
)
async def test_a_move_that_cannot_be_is_refused_before_motion(request_: cb.Move, status: Status) -> None:
    async with talking() as (cell, client):
        assert await client.asks(request_) == cb.Refused(status)
        assert await client.moves(GOOD) is Status.OK
        assert (cell.commanded_moves, cell.controller.arm.departures) == (1, 1)


async def test_motion_needs_arming_in_this_session() -> None:
    async with talking(armed=False) as (cell, client):
        session = cell.controller.session
        assert await client.asks(GOOD) == cb.Refused(Status.NOT_ARMED)
        assert await client.asks(cb.SetArmed(session + 1, True)) == cb.Refused(Status.NOT_ARMED)
        assert await client.asks(cb.SetArmed(session, True)) == cb.ArmingDone()
        assert cell.controller.armed
        assert await client.asks(cb.SetArmed(session, False)) == cb.ArmingDone()
        assert await client.asks(GOOD) == cb.Refused(Status.NOT_ARMED)


@WIRES
async def test_a_repeated_move_is_answered_from_memory_and_never_moves_twice(serial: bool) -> None:
    async with talking(serial=serial) as (cell, client):
        request = client.session.request(GOOD)
        answers = {await answer_to(client, request) for _ in range(3)}
        assert len(answers) == 1
        client.session.receive_data(answers.pop())
        assert await ends_as(client, client.session.last_seq) is Status.OK
        assert (cell.commanded_moves, cell.controller.arm.departures) == (1, 1)


async def test_the_same_number_and_the_same_sum_with_another_goal_is_no_repeat() -> None:
    async with talking() as (cell, client):
        request = bytearray(client.session.request(replace(GOOD, speed_mm_s=200.0)))
        client.session.receive_data(await answer_to(client, bytes(request)))
        seq = client.session.last_seq
        place = next(at for at in range(12, len(request)) if request[at] == 0)
        request[place] = 0xFF  # Fletcher's sums are taken modulo 255: 0 and 255 are the same to them
        answer = await answer_to(client, bytes(request))
        assert struct.unpack("<H", answer[6:8])[0] == Status.DUPLICATE_SEQ_DIFFERENT_PAYLOAD
        assert await ends_as(client, seq) is Status.OK
        assert cell.commanded_moves == 1


async def test_stop_from_the_second_task_ends_a_move_under_way() -> None:
    async with talking(time_scale=1.0) as (cell, client):
        assert await client.asks(GOOD) == cb.MoveAccepted()
        seq = client.session.last_seq
        await eventually(lambda: cell.moving)
        under_way = await report_of(client)
        assert under_way.flags & Flag.MOVING
        assert await client.asks(move_to(AWAY)) == cb.Refused(Status.BUSY)
        assert await client.asks(cb.Stop()) == cb.Stopped()
        assert await ends_as(client, seq) is Status.ABORTED
        assert not cell.moving
        assert np.abs(joints_now(cell) - AWAY).max() > 0.01
        assert cell.controller.armed, "STOP alone does not disarm"


async def test_two_seconds_of_silence_stop_and_disarm() -> None:
    async with talking(time_scale=1.0) as (cell, client):
        assert await client.asks(move_to(AWAY, 20.0)) == cb.MoveAccepted()
        await eventually(lambda: cell.moving)
        await eventually(lambda: not cell.controller.armed)
        await eventually(lambda: not cell.moving)
        assert np.abs(joints_now(cell) - AWAY).max() > 0.01


@pytest.mark.parametrize(
    ("switch", "status"),
    [
        (lambda c, t: c.press_emergency_stop(True, t), Status.ESTOP),
        (lambda c, t: c.switch_motors(False, t), Status.MOTORS_OFF),
        (lambda c, t: c.switch_mode(Mode.MANF, t), Status.WRONG_MODE),
        (lambda c, t: c.run_program(False, t), Status.WRONG_MODE),
    ],
    ids=["e-stop", "motors off", "manual full speed", "program stopped"],
)
async def test_a_switch_ends_the_move_and_starting_the_program_again_moves_nothing(switch, status) -> None:  # type: ignore[no-untyped-def]
    async with talking(time_scale=2.0) as (cell, client):
        assert await client.asks(move_to(AWAY, 100.0)) == cb.MoveAccepted()
        seq = client.session.last_seq
        await eventually(lambda: cell.moving)
        switch(cell.controller, cell.cell.clock())
        assert await ends_as(client, seq) is status
        assert not cell.controller.armed
        assert await client.asks(cb.SetArmed(cell.controller.session, True)) == cb.Refused(status)
        await moves_again(cell, client)


async def test_an_interrupted_move_does_not_go_on_though_the_client_is_gone() -> None:
    async with running_cell(time_scale=2.0, devices=False, program="rapid") as cell:
        async with over_tcp(int(cell.announcement.robot_port or 0)) as client:
            await client.is_armed()
            assert await client.asks(move_to(AWAY, 100.0)) == cb.MoveAccepted()
            await eventually(lambda: cell.moving)
            cell.controller.run_program(False, cell.cell.clock())
            await eventually(lambda: not cell.controller.armed)
        await eventually(lambda: not cell.moving)
        standing = joints_now(cell)
        cell.controller.recover(cell.cell.clock())
        async with over_tcp(int(cell.announcement.robot_port or 0)) as client:
            await client.is_armed()
            np.testing.assert_array_equal(joints_now(cell), standing)
            assert cell.commanded_moves == 1


async def test_a_move_that_was_refused_because_the_motion_task_was_late_never_begins() -> None:
    async with talking() as (cell, client):
        async with late(cell, "joints_for"):
            assert await client.asks(GOOD) == cb.Refused(Status.WRONG_MODE)
            assert not cell.controller.armed
        await moves_again(cell, client)
        assert cell.controller.arm.departures == 1, "the second one alone"


async def test_after_a_greeting_nothing_moves_though_the_move_before_was_late() -> None:
    async with talking() as (cell, client):
        async with late(cell, "order"):
            assert await client.asks(GOOD) == cb.MoveAccepted()
            assert isinstance(await client.asks(cb.Hello(1, 1, 9)), cb.Welcome)
        await eventually(lambda: cell.commanded_moves == 1)
        await moves_again(cell, client)
        assert cell.controller.arm.departures == 1, "the second one alone"


@asynccontextmanager
async def late(cell: RunningCell, step: str) -> AsyncIterator[None]:
    """Within it the motion task does not get past that step of a move."""
    unit = cell.controller.unit  # type: ignore[attr-defined]
    goes_on, does = threading.Event(), getattr(unit, step)

    def does_late(*arguments: object) -> object:
        assert goes_on.wait(LIMIT_S)
        return does(*arguments)

    setattr(unit, step, does_late)
    try:
        yield
    finally:
        setattr(unit, step, does)
        goes_on.set()


async def a_line_fails(cell: RunningCell, client: CbClient) -> None:
    """A straight line through the arm's own column: the program stops on the way."""
    across = np.radians([175.0, 15.0, 0.0, 0.0, 65.0, 0.0])
    cell.controller.memory["cell_box_low"].value = [-2000.0, -2000.0, 0.0]  # type: ignore[attr-defined]
    assert await client.asks(move_to(across, kind=MoveKind.LINEAR)) == cb.MoveAccepted()
    assert await ends_as(client, client.session.last_seq) is Status.MOTION_ERROR


async def test_a_line_that_cannot_be_followed_ends_in_a_motion_error_with_abbs_number_in_the_log() -> None:
    async with talking() as (cell, client):
        await a_line_fails(cell, client)
        assert cell.controller.log[-1].code == 50026
        assert await client.asks(cb.SetArmed(cell.controller.session, True)) == cb.Refused(Status.MOTION_ERROR)
        await moves_again(cell, client)


async def test_an_abort_that_comes_with_the_start_of_the_program_ends_the_old_move_alone() -> None:
    """The traps of before are still connected then, and the program pointer is still at the move that failed."""
    async with talking() as (cell, client):
        controller = cell.controller
        assert isinstance(controller, RapidController)
        await a_line_fails(cell, client)
        motion = next(loaded.task for loaded in controller._loaded if loaded.task.name == "T_ROB1")
        starts = motion.start

        def start_and_ring() -> None:
            with motion._turn:  # the trap is pending before the task's first step
                starts()
                controller.memory.preset("cell_bell", 1.0 - controller.memory["cell_bell"].value)

        motion.start = start_and_ring  # type: ignore[method-assign]
        errors = [entry.code for entry in controller.log if entry.code == 10020]
        await moves_again(cell, client)
        assert [entry.code for entry in controller.log if entry.code == 10020] == errors == []


async def test_after_a_motion_error_the_program_may_also_begin_at_main() -> None:
    async with talking() as (cell, client):
        assert isinstance(cell.controller, RapidController)
        await a_line_fails(cell, client)
        cell.controller.move_pointer_to_main(cell.cell.clock())
        await moves_again(cell, client)


WRISTS = [np.radians(turn) for turn in ([0.0, 0.0, 0.0, 0.0, 0.0, 90.0], [0.0, 0.0, 0.0, 60.0, -60.0, 0.0])]


@pytest.mark.parametrize("joints", [*(HOME + turn for turn in WRISTS), AWAY], ids=["roll", "tilt", "away"])
@pytest.mark.parametrize("kind", MoveKind)
async def test_no_point_at_the_flange_moves_faster_than_the_request_allows(joints: np.ndarray, kind: MoveKind) -> None:
    limit_mm_s = 80.0
    async with talking(time_scale=5.0) as (cell, client):
        assert await client.asks(move_to(joints, limit_mm_s, kind=kind)) == cb.MoveAccepted()
        await eventually(lambda: cell.moving)
        arm, reach = cell.controller.arm, cell.controller.memory["cell_reach"].value  # type: ignore[attr-defined]
        assert fastest_mm_s(arm, reach * np.array([*np.eye(3), *-np.eye(3)])) <= 1.001 * limit_mm_s


async def test_manual_reduced_speed_is_capped_by_the_program() -> None:
    async with talking(time_scale=5.0) as (cell, client):
        cell.controller.switch_mode(Mode.MANR, cell.cell.clock())
        cell.controller.run_program(True, cell.cell.clock())
        await client.is_armed()
        assert (await report_of(client)).flags & Flag.SPEED_LIMITED
        asked_s = cell.controller.robot_s(cell.cell.clock())
        slow = plan_motion(ARM, joints_now(cell), AWAY, 250.0, linear=False, now_s=0.0).end_s
        assert await client.asks(move_to(AWAY, 1000.0)) == cb.MoveAccepted()
        await eventually(lambda: cell.moving)
        assert cell.controller.arm.end_s - asked_s >= slow
        assert await ends_as(client, client.session.last_seq) is Status.OK
