"""What the controller does with each request, and when it refuses."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.transforms import quaternion_from_rotation
from mock_robot.cabinet.panel import Mode
from mock_robot.links.cb_program import CAMERA_LOAD, REACH_MM
from protocols.cb import messages as cb
from protocols.cb.client import Unsolicited
from protocols.cb.codes import Flag, MoveKind, Status
from tests.mock_robot.controller_client import (
    ARM,
    AWAY,
    HOME,
    UNUSED,
    ControllerClient,
    bare_controller,
    fastest_mm_s,
    joints_now,
    move_to,
)


def test_a_move_is_accepted_at_once_runs_and_ends() -> None:
    client = ControllerClient().is_armed()
    assert client.asks(move_to(AWAY)) == cb.MoveAccepted()
    seq = client.session.last_seq
    client.passes(1.0)
    under_way = client.report()
    assert under_way.flags & Flag.MOVING
    assert not under_way.flags & Flag.IN_POSITION
    assert 0 < under_way.progress_per_mille < 1000
    assert under_way.finished_seq == 0
    assert client.finishes(seq) is Status.OK
    at_goal = client.report()
    assert at_goal.flags & Flag.IN_POSITION
    assert not at_goal.flags & Flag.MOVING
    np.testing.assert_allclose(joints_now(client), AWAY, atol=1e-6)


def test_the_pose_is_float32_carries_the_configuration_and_moves_while_moving() -> None:
    client = ControllerClient().is_armed()
    client.asks(move_to(AWAY))
    seen = []
    for _ in range(3):
        client.passes(0.3)
        seen.append(client.pose())
    assert len({pose.position_mm for pose in seen}) == 3
    client.finishes(client.session.last_seq - 3)
    pose = client.pose()
    assert all(value == np.float32(value) for value in (*pose.position_mm, *pose.quaternion_wxyz))
    expected = ARM.forward(AWAY)
    np.testing.assert_allclose(pose.position_mm, expected[:3, 3], atol=2e-4)
    np.testing.assert_allclose(pose.quaternion_wxyz, quaternion_from_rotation(expected[:3, :3]), atol=1e-6)
    assert pose.configuration == ARM.configuration(AWAY)
    assert all(axis >= 8.9e9 for axis in pose.external_axes)
    joints = client.asks(cb.GetJoints())
    assert isinstance(joints, cb.Joints)
    np.testing.assert_allclose(joints.axes_deg, np.degrees(AWAY), atol=1e-4)


def test_a_pose_read_and_sent_back_moves_nothing_but_is_a_move() -> None:
    client = ControllerClient().is_armed()
    pose = client.pose()
    echoed = cb.Move(
        pose.position_mm, pose.quaternion_wxyz, pose.configuration, pose.external_axes, 100.0, MoveKind.JOINT
    )
    assert client.asks(echoed) == cb.MoveAccepted()
    assert client.finishes(client.session.last_seq) is Status.OK
    np.testing.assert_allclose(joints_now(client), HOME, atol=1e-5)


GOOD = move_to(AWAY)
NAN = float("nan")


@pytest.mark.parametrize(
    ("request_", "status"),
    [
        (replace(GOOD, position_mm=(1590.0, 0.0, 486.5)), Status.UNREACHABLE),
        (replace(GOOD, configuration=(*GOOD.configuration[:3], 6)), Status.UNREACHABLE),
        (replace(GOOD, configuration=(3, *GOOD.configuration[1:])), Status.UNREACHABLE),
        (replace(GOOD, position_mm=(900.0, 0.0, -50.0)), Status.OUTSIDE_BOX),
        (replace(GOOD, speed_mm_s=0.0), Status.SPEED),
        (replace(GOOD, speed_mm_s=-5.0), Status.SPEED),
        (replace(GOOD, speed_mm_s=7000.0), Status.SPEED),
        (replace(GOOD, speed_mm_s=NAN), Status.SPEED),
        (replace(GOOD, position_mm=(NAN, 0.0, 0.0)), Status.BAD_FIELD),
        (replace(GOOD, quaternion_wxyz=(NAN, 0.0, 0.0, 1.0)), Status.BAD_FIELD),
        (replace(GOOD, quaternion_wxyz=(0.9, 0.0, 0.0, 0.0)), Status.BAD_FIELD),
        (replace(GOOD, quaternion_wxyz=(0.0, 0.0, 0.0, 0.0)), Status.BAD_FIELD),
        (replace(GOOD, external_axes=(NAN, *UNUSED[1:])), Status.BAD_FIELD),
    ],
)
def test_a_move_that_cannot_be_is_refused_by_name_and_nothing_moves(request_: cb.Move, status: Status) -> None:
    client = ControllerClient().is_armed()
    assert client.asks(request_) == cb.Refused(status)
    client.passes(1.0)
    np.testing.assert_array_equal(joints_now(client), HOME)
    assert client.controller.moves_accepted == 0
    assert status.name in client.controller.log[-1].text


def test_motion_needs_arming_in_this_session() -> None:
    client = ControllerClient().is_greeted()
    assert client.asks(GOOD) == cb.Refused(Status.NOT_ARMED)
    assert client.asks(cb.SetArmed(client.controller.session + 1, True)) == cb.Refused(Status.NOT_ARMED)
    assert client.asks(GOOD) == cb.Refused(Status.NOT_ARMED)
    assert client.asks(cb.SetArmed(client.controller.session, True)) == cb.ArmingDone()
    assert client.asks(GOOD) == cb.MoveAccepted()


def test_a_second_move_is_busy_until_the_arm_has_settled() -> None:
    client = ControllerClient().is_armed()
    client.asks(GOOD)
    first = client.session.last_seq
    client.passes(0.5)
    assert client.asks(move_to(HOME)) == cb.Refused(Status.BUSY)
    assert client.finishes(first) is Status.OK
    assert client.asks(move_to(HOME)) == cb.MoveAccepted()


def test_stop_in_motion_slows_the_arm_to_a_stand_and_the_move_ends_aborted() -> None:
    client = ControllerClient().is_armed()
    client.asks(GOOD)
    seq = client.session.last_seq
    client.passes(1.0)
    when_told = joints_now(client)
    assert client.asks(cb.Stop()) == cb.Stopped()
    assert client.report().flags & Flag.MOVING, "an arm of 100 kg does not stand at once"
    client.passes(0.2)
    standing = joints_now(client)
    client.passes(1.0)
    np.testing.assert_array_equal(joints_now(client), standing)
    assert 0 < np.abs(standing - when_told).max() < np.abs(AWAY - when_told).max()
    assert client.finishes(seq) is Status.ABORTED


def test_stop_while_standing_is_no_event() -> None:
    client = ControllerClient().is_armed()
    assert client.asks(cb.Stop()) == cb.Stopped()
    assert client.report().finished_seq == 0


def test_a_repeated_move_is_answered_from_memory_and_never_moves_twice() -> None:
    client = ControllerClient().is_armed()
    request = client.session.request(GOOD)
    for _ in range(3):
        client.sends(request)
    assert client.finishes(client.session.last_seq) is Status.OK
    assert client.controller.arm.departures == 1
    assert client.controller.moves_accepted == 1


def test_a_repeat_after_the_move_ended_does_not_move_again() -> None:
    client = ControllerClient().is_armed()
    request = client.session.request(GOOD)
    client.sends(request)
    for _ in range(20):
        client.passes(1.0)
        client.link.receive_data(request, client.now_s)
    assert not client.controller.flags(client.now_s) & Flag.MOVING
    assert client.controller.arm.departures == 1


def test_two_seconds_of_silence_stop_and_disarm() -> None:
    client = ControllerClient().is_armed()
    client.asks(move_to(AWAY, speed_mm_s=50.0))
    client.passes(1.9)
    assert client.controller.armed
    assert client.controller.flags(client.now_s) & Flag.MOVING
    client.passes(0.5)
    assert not client.controller.armed
    assert not client.controller.flags(client.now_s) & Flag.MOVING
    assert np.abs(joints_now(client) - AWAY).max() > 0.01


def test_pings_keep_a_long_move_going() -> None:
    client = ControllerClient().is_armed()
    client.asks(move_to(AWAY, speed_mm_s=50.0))
    for _ in range(12):
        client.passes(0.5)
        assert client.asks(cb.Ping()) == cb.Pong()
    assert client.controller.armed
    assert client.controller.flags(client.now_s) & Flag.MOVING


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
def test_a_switch_stops_disarms_and_forbids_motion_by_its_name(switch, status) -> None:  # type: ignore[no-untyped-def]
    client = ControllerClient().is_armed()
    client.asks(GOOD)
    seq = client.session.last_seq
    client.passes(1.0)
    switch(client.controller, client.now_s)
    assert client.finishes(seq) is status
    assert not client.controller.armed
    assert client.asks(move_to(HOME)) == cb.Refused(status)
    assert client.asks(cb.SetArmed(client.controller.session, True)) == cb.Refused(status)


def test_releasing_the_emergency_stop_gives_no_power_back() -> None:
    client = ControllerClient().is_armed()
    client.controller.press_emergency_stop(True, client.now_s)
    client.controller.switch_motors(True, client.now_s)
    assert client.report().flags & Flag.ESTOP
    client.controller.press_emergency_stop(False, client.now_s)
    assert not client.report().flags & (Flag.ESTOP | Flag.MOTORS_ON | Flag.ARMED)
    client.controller.switch_motors(True, client.now_s)
    assert client.report().flags & Flag.MOTORS_ON
    assert client.asks(GOOD) == cb.Refused(Status.NOT_ARMED)


def seconds_of_the_move(client: ControllerClient, request: cb.Move) -> float:
    begun_s = client.now_s
    client.asks(request)
    while client.controller.flags(client.now_s) & Flag.MOVING:
        client.passes(0.02, step_s=0.02)
        client.asks(cb.Ping())
    return client.now_s - begun_s


def test_manual_reduced_speed_caps_at_250_mm_s() -> None:
    automatic = seconds_of_the_move(ControllerClient().is_armed(), move_to(AWAY, 1000.0))
    client = ControllerClient()
    client.controller.switch_mode(Mode.MANR, 0.0)
    client.is_armed()
    assert client.report().flags & Flag.SPEED_LIMITED
    manual = seconds_of_the_move(client, move_to(AWAY, 1000.0))
    capped = seconds_of_the_move(ControllerClient().is_armed(), move_to(AWAY, 250.0))
    assert automatic < 0.5 * manual
    assert manual == pytest.approx(capped, abs=0.05)


def test_time_scale_makes_the_arm_faster_not_the_heartbeat() -> None:
    slow = seconds_of_the_move(ControllerClient().is_armed(), GOOD)
    fast_bench = ControllerClient(bare_controller(time_scale=10.0)).is_armed()
    fast = seconds_of_the_move(fast_bench, GOOD)
    assert fast == pytest.approx(slow / 10, abs=0.03)
    fast_bench.passes(1.5)
    assert fast_bench.controller.armed, "1.5 s on the wire are 1.5 s"


def test_a_line_is_followed_straight() -> None:
    client = ControllerClient().is_armed()
    start, goal = ARM.forward(HOME), ARM.forward(AWAY)
    assert client.asks(move_to(AWAY, kind=MoveKind.LINEAR)) == cb.MoveAccepted()
    seq = client.session.last_seq
    direction = (goal - start)[:3, 3] / np.linalg.norm((goal - start)[:3, 3])
    for _ in range(4):
        client.passes(0.4)
        offset = np.array(client.pose().position_mm) - start[:3, 3]
        assert np.linalg.norm(offset - (offset @ direction) * direction) < 1e-3
    assert client.finishes(seq) is Status.OK


def test_a_line_through_a_singularity_ends_in_a_motion_error_short_of_it() -> None:
    client = ControllerClient().is_armed()
    across = np.radians([175.0, 15.0, 0.0, 0.0, 65.0, 0.0])  # straight through the robot's own column
    assert client.asks(move_to(across, kind=MoveKind.LINEAR)) == cb.MoveAccepted()
    assert client.finishes(client.session.last_seq) is Status.MOTION_ERROR
    assert np.abs(joints_now(client) - across).max() > 0.5


def test_the_end_of_a_move_is_announced_unasked() -> None:
    client = ControllerClient(bare_controller(time_scale=20.0)).is_armed()
    client.asks(GOOD)
    seq = client.session.last_seq
    announced = [event.reply for event in client.passes(1.5) if isinstance(event, Unsolicited)]
    assert [report.finished_seq for report in announced if isinstance(report, cb.Report)] == [seq]


def test_bye_disarms_and_hello_forgets_the_last_move() -> None:
    client = ControllerClient().is_armed()
    client.asks(GOOD)
    client.finishes(client.session.last_seq)
    assert client.asks(cb.Bye()) == cb.Farewell()
    assert client.closed
    assert not client.controller.armed
    client.connects()
    client.is_greeted()
    assert client.report().finished_seq == 0


def test_a_hello_in_motion_is_a_new_client_and_stops_the_arm() -> None:
    client = ControllerClient(serial=True).is_armed()
    client.asks(GOOD)
    client.passes(1.0)
    client.is_greeted()
    client.passes(0.5)
    assert not client.controller.armed
    assert not client.controller.flags(client.now_s) & Flag.MOVING
    assert np.abs(joints_now(client) - AWAY).max() > 0.01


def test_half_a_frame_then_silence_closes_tcp_and_resynchronises_serial() -> None:
    for serial in (False, True):
        client = ControllerClient(serial=serial).is_greeted()
        client.sends(client.session.request(cb.Ping())[:7])
        client.passes(0.6)
        assert client.closed is not serial
        if serial:
            client.session.abandon()
            assert client.asks(cb.Ping()) == cb.Pong()


def test_a_client_that_says_nothing_loses_its_place() -> None:
    client = ControllerClient().is_greeted()
    client.passes(9.5)
    assert not client.closed
    client.passes(1.0)
    assert client.closed


def test_t_ms_counts_from_hello() -> None:
    client = ControllerClient(now_s=100.0).is_greeted()
    client.passes(1.25)
    assert client.report().t_ms == pytest.approx(1250, abs=1)


WRISTS = [np.radians(turn) for turn in ([0.0, 0.0, 0.0, 0.0, 0.0, 90.0], [0.0, 0.0, 0.0, 60.0, -60.0, 0.0])]


@pytest.mark.slow
@pytest.mark.parametrize("joints", [*(HOME + turn for turn in WRISTS), AWAY], ids=["roll", "tilt", "away"])
@pytest.mark.parametrize("kind", MoveKind)
def test_no_point_within_reach_moves_faster_than_the_request_allows(joints: np.ndarray, kind: MoveKind) -> None:
    """As the RAPID limits turning (cell_speed); without it a roll by 90 deg has 600 mm/s and more at the camera."""
    client = ControllerClient().is_armed()
    assert client.asks(move_to(joints, 80.0, kind=kind)) == cb.MoveAccepted()
    points = REACH_MM * np.array([*np.eye(3), *-np.eye(3)])
    assert fastest_mm_s(client.controller.arm, points) <= 1.001 * 80.0


def test_a_goal_beyond_a_border_of_confdata_is_reached_and_too_much_travel_is_refused() -> None:
    border, beyond = np.radians([[0.2, 15.0, 0.0, -0.2, 65.0, 0.2], [-2.0, 15.0, 0.0, 3.0, 65.0, -2.0]])
    client = ControllerClient(bare_controller(border)).is_armed()
    request = replace(move_to(beyond), configuration=ARM.configuration(border))
    assert ARM.configuration(border) != ARM.configuration(beyond)
    assert client.asks(request) == cb.MoveAccepted()
    assert client.finishes(client.session.last_seq) is Status.OK
    np.testing.assert_allclose(joints_now(client), beyond, atol=1e-4)
    turned = cb.MoveJoints((-2.0, 15.0, 0.0, 3.0, 65.0, 300.0), UNUSED, 100.0)
    assert client.asks(turned) == cb.Refused(Status.UNREACHABLE)
    assert client.asks(replace(turned, axes_deg=(10.0, 15.0, 0.0, 0.0, 0.0, 0.0))) == cb.JointMoveAccepted()


def test_the_load_of_tool0_and_an_open_interlock_are_refused() -> None:
    client = ControllerClient().is_armed()
    client.controller.load = (0.001, (0.0, 0.0, 0.001))
    assert client.asks(move_to(AWAY)) == cb.Refused(Status.NO_LOAD)
    client.controller.load = CAMERA_LOAD
    client.controller.interlocks["gate"] = False
    assert client.asks(cb.SetArmed(77, True)) == cb.Refused(Status.INTERLOCK)
