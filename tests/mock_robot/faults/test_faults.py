"""Each named fault: what it does to the wire, the answers or the robot. Nothing ever moves twice."""

import random
from dataclasses import replace

import numpy as np
import pytest

from mock_robot.cabinet.wire_steps import Close, Pause, Reset, Send
from mock_robot.errors import UnknownFault
from mock_robot.faults.tables import FAULTS
from protocols.cb import messages as cb
from protocols.cb.client import GarbledReply, GreetingLost, RepeatWanted, ReplyReceived, UnexpectedReply
from protocols.cb.codes import Command, Flag, SessionState, Status
from protocols.cb.frames import ChecksumFailed, FramingBroken, GarbageSkipped
from tests.mock_robot.controller_client import AWAY, HOME, ControllerClient, bare_controller, joints_now, move_to

STATUS = cb.GetStatus()


def broken(fault: str, *, serial: bool = False, **how: int) -> ControllerClient:
    """A greeted client with that fault on."""
    client = ControllerClient(serial=serial).is_greeted()
    client.faults.switch_on(fault, client.controller, client.now_s, **how)  # type: ignore[arg-type]
    return client


def steps_of(client: ControllerClient, request: cb.Request = STATUS) -> list[object]:
    return list(client.link.receive_data(client.session.request(request), client.now_s))


def test_every_fault_has_a_place_to_strike_and_a_sentence() -> None:
    for name, fault in FAULTS.items():
        assert fault.area in ("rws", "egm") or any((fault.begin, fault.reply, fault.send, fault.receive)), name
        assert fault.summary
    assert len(FAULTS) >= 30


def test_delay_pauses_before_every_reply_and_stall_once() -> None:
    client = broken("link-delay")
    for _ in range(2):
        pause, sent = steps_of(client)
        assert isinstance(pause, Pause)
        assert isinstance(sent, Send)
        client.session.abandon()
    assert [type(step) for step in steps_of(broken("link-stall"))] == [Pause, Send]


def test_split_sends_byte_by_byte_and_the_client_understands() -> None:
    client = broken("link-split")
    assert isinstance(client.asks(STATUS), cb.Report)
    client = broken("link-split")
    assert all(len(step.data) == 1 for step in steps_of(client) if isinstance(step, Send))


def test_links_that_break() -> None:
    assert [type(step) for step in steps_of(broken("link-drop-mid-frame"))] == [Send, Close]
    assert steps_of(broken("link-close")) == [Close()]
    assert steps_of(broken("link-reset")) == [Reset()]


def test_half_open_hears_nothing_until_it_is_mended_and_the_heartbeat_strikes() -> None:
    client = ControllerClient().is_armed()
    client.asks(move_to(AWAY, 50.0))
    client.faults.switch_on("link-half-open", client.controller, client.now_s)
    for _ in range(5):
        assert client.sends(client.session.request(cb.Ping())) == []
        client.session.abandon()
        client.passes(0.5)
    assert not client.controller.armed
    assert not client.controller.flags(client.now_s) & Flag.MOVING
    client.faults.clear(client.controller, client.now_s)
    assert client.asks(cb.Ping()) == cb.Pong()


def test_a_lost_reply_leaves_the_request_done_and_a_repeat_is_answered() -> None:
    client = ControllerClient().is_armed()
    client.faults.switch_on("link-reply-lost", client.controller, client.now_s, only=Command.MOVE)
    assert isinstance(client.asks(STATUS), cb.Report), "other replies are not lost"
    assert client.sends(client.session.request(move_to(AWAY))) == []
    assert client.controller.moves_accepted == 1
    [answered] = client.sends(client.session.repeat())
    assert isinstance(answered, ReplyReceived)
    assert answered.reply == cb.MoveAccepted()
    assert client.controller.moves_accepted == 1


@pytest.mark.parametrize("serial", [False, True])
def test_a_flipped_bit_is_noticed(serial: bool) -> None:
    heard = broken("link-bit-flip", serial=serial).sends(ControllerClient().is_greeted().session.request(STATUS))
    noticed = (ChecksumFailed, GarbledReply, FramingBroken, GarbageSkipped, UnexpectedReply)
    assert not heard or isinstance(heard[0], noticed)


def test_a_request_with_a_flipped_bit_is_not_done_and_closes_tcp() -> None:
    for seed in range(40):
        client = ControllerClient().is_armed()
        client.faults._random.seed(seed)
        client.faults.switch_on("link-request-bit-flip", client.controller, client.now_s)
        heard = client.sends(client.session.request(move_to(AWAY)))
        client.passes(1.0)
        assert client.controller.moves_accepted == 0
        assert client.closed or any(isinstance(event, RepeatWanted) for event in heard)


def test_duplicates_in_both_directions_move_once() -> None:
    for fault in ("link-duplicate", "link-request-duplicate"):
        client = ControllerClient().is_armed()
        client.faults.switch_on(fault, client.controller, client.now_s)
        heard = client.sends(client.session.request(move_to(AWAY)))
        assert isinstance(heard[0], ReplyReceived)
        assert [type(event) for event in heard[1:]] == [UnexpectedReply]
        assert client.controller.arm.departures == 1


@pytest.mark.parametrize("fault", ["link-garbage", "serial-noise", "serial-magic-in-noise"])
def test_dirt_before_a_frame_breaks_tcp_and_is_skipped_on_a_serial_line(fault: str) -> None:
    client = broken(fault, serial=True)
    heard = client.sends(client.session.request(STATUS))
    heard += client.session.abandon_half_frame()
    assert any(isinstance(event, GarbageSkipped | ChecksumFailed) for event in heard)
    assert any(isinstance(event, ReplyReceived) for event in heard)
    client = broken(fault)
    assert any(isinstance(event, FramingBroken) for event in client.sends(client.session.request(STATUS)))


@pytest.mark.parametrize("fault", ["serial-half-frame", "serial-doubled-byte", "serial-break"])
def test_a_spoilt_reply_on_a_serial_line_is_repeated_and_then_understood(fault: str) -> None:
    for seed in range(30):
        client = ControllerClient(serial=True).is_armed()
        client.faults._random.seed(seed)
        client.faults.switch_on(fault, client.controller, client.now_s)
        heard = client.sends(client.session.request(move_to(AWAY)))
        heard += client.session.abandon_half_frame()
        if not any(isinstance(event, ReplyReceived) for event in heard):
            heard = client.sends(client.session.repeat()) + client.session.abandon_half_frame()
        assert any(isinstance(event, ReplyReceived) for event in heard)
        assert client.controller.arm.departures == 1


def test_a_restart_closes_tcp_and_asks_a_serial_client_to_greet_again() -> None:
    client = ControllerClient().is_armed()
    client.faults.switch_on("link-restart", client.controller, client.now_s)
    client.passes(0.1)
    assert client.closed
    assert client.controller.session == 78
    client = ControllerClient(serial=True).is_armed()
    client.faults.switch_on("link-restart", client.controller, client.now_s)
    heard = client.sends(client.session.request(STATUS))
    assert any(isinstance(event, GreetingLost) for event in heard)
    assert client.session.state is SessionState.NOT_GREETED
    assert not client.controller.armed


@pytest.mark.parametrize(
    ("fault", "status"),
    [
        ("robot-emergency-stop", Status.ESTOP),
        ("robot-motors-off", Status.MOTORS_OFF),
        ("robot-manual-mode", Status.WRONG_MODE),
        ("robot-program-stopped", Status.WRONG_MODE),
    ],
)
def test_robot_faults_stop_a_move_by_their_name_and_mending_does_not_arm(fault: str, status: Status) -> None:
    client = ControllerClient().is_armed()
    client.asks(move_to(AWAY, 50.0))
    seq = client.session.last_seq
    client.passes(0.5)
    client.faults.switch_on(fault, client.controller, client.now_s)
    assert client.finishes(seq) is status
    client.faults.clear(client.controller, client.now_s, fault)
    standing = joints_now(client)
    client.passes(1.0)
    np.testing.assert_array_equal(joints_now(client), standing)
    refused = client.asks(move_to(HOME))
    assert isinstance(refused, cb.Refused)


def test_an_arm_that_never_settles_never_finishes() -> None:
    client = ControllerClient(bare_controller(time_scale=50.0)).is_armed()
    client.faults.switch_on("robot-not-settled", client.controller, client.now_s)
    client.asks(move_to(AWAY))
    seq = client.session.last_seq
    client.passes(1.0)
    report = client.report()
    assert report.finished_seq == 0
    assert not report.flags & Flag.IN_POSITION
    client.faults.clear(client.controller, client.now_s)
    assert client.finishes(seq) is Status.OK


def test_speed_override_zero_accepts_a_move_that_goes_nowhere() -> None:
    client = ControllerClient().is_armed()
    client.faults.switch_on("robot-override-zero", client.controller, client.now_s)
    assert client.asks(move_to(AWAY)) == cb.MoveAccepted()
    client.passes(1.0)
    assert client.report().flags & Flag.SPEED_LIMITED
    assert np.abs(joints_now(client) - HOME).max() < 1e-3
    assert client.report().progress_per_mille == 0


def test_poses_that_lie() -> None:
    honest = ControllerClient().is_greeted().pose()

    def lying(fault: str) -> cb.Pose:
        return broken(fault).pose()

    assert all(value != value for value in lying("robot-nan-pose").position_mm)
    assert np.linalg.norm(lying("robot-quaternion-not-unit").quaternion_wxyz) == pytest.approx(0.9)
    np.testing.assert_allclose(np.array(lying("robot-metres").position_mm) * 1000, honest.position_mm, rtol=1e-6)
    shifted = lying("robot-quaternion-xyzw").quaternion_wxyz
    assert (shifted[3], *shifted[:3]) == honest.quaternion_wxyz
    assert lying("robot-wrong-configuration").configuration[3] == honest.configuration[3] ^ 2
    assert lying("robot-clock-jump").t_ms >= 3_600_000
    assert replace(honest, t_ms=0, flags=Flag(0)) != lying("robot-metres")


def test_a_fault_may_wait_for_a_move_and_count_its_strikes() -> None:
    client = ControllerClient(bare_controller(time_scale=100.0)).is_armed()
    client.faults.switch_on("link-reply-lost", client.controller, client.now_s, strikes=2, after_moves=2)
    for goal in (AWAY, HOME):
        assert client.asks(move_to(goal)) == cb.MoveAccepted()
        seq = client.session.last_seq
        if goal is AWAY:
            assert client.finishes(seq) is Status.OK
    for _ in range(2):
        assert client.sends(client.session.request(STATUS)) == []
        client.session.abandon()
    assert isinstance(client.asks(STATUS), cb.Report)
    assert not client.faults.active


def test_an_unknown_fault_lists_the_known() -> None:
    client = ControllerClient()
    with pytest.raises(UnknownFault, match="serial-noise"):
        client.faults.switch_on("nope", client.controller, 0.0)
    with pytest.raises(UnknownFault):
        client.faults.clear(client.controller, 0.0, "nope")


LINE_FAULTS = sorted(name for name, fault in FAULTS.items() if fault.area in ("link", "serial"))


@pytest.mark.slow
@pytest.mark.parametrize("serial", [False, True], ids=["tcp", "serial"])
def test_no_random_schedule_of_faults_moves_twice_for_one_request(serial: bool) -> None:
    """A client that repeats what was not answered: as many departures as distinct MOVE requests, at most."""
    departures = 0
    for seed in range(500):
        schedule = random.Random(seed)
        client = ControllerClient(bare_controller(time_scale=50.0), serial=serial).is_armed()
        client.faults._random.seed(seed)
        requests = 0
        for _ in range(4):
            fault = schedule.choice(LINE_FAULTS)
            client.faults.switch_on(fault, client.controller, client.now_s, after_moves=schedule.randrange(2))
            if client.closed or client.session.state is not SessionState.GREETED:
                break
            client.session.abandon()
            data = client.session.request(move_to(schedule.choice([HOME, AWAY])))
            requests += 1
            for _ in range(schedule.randrange(1, 4)):
                client.sends(data)
                client.passes(0.3)
            client.faults.clear(client.controller, client.now_s)
        assert client.controller.arm.departures <= requests
        departures += client.controller.arm.departures
    assert departures > 500, "the schedules must let the arm move, or they show nothing"


def test_faults_may_strike_what_another_has_swallowed() -> None:
    client = broken("link-half-open")
    client.faults.switch_on("link-request-bit-flip", client.controller, client.now_s)
    assert client.faults.alter_incoming(b"anything") == b""
