"""Each named fault: what it does to the wire, the answers or the robot. Nothing ever moves twice."""

import random
from dataclasses import replace

import numpy as np
import pytest

from mock_robot.cabinet.wire_steps import Close, Pause, Reset, Send
from mock_robot.errors import UnknownFault
from mock_robot.faults.robot_faults import FAULTS
from protocols.cb import messages as cb
from protocols.cb.client import ClientSessionState
from protocols.cb.codes import Command, Flag, Status
from protocols.cb.events import (
    GarbledReply,
    GreetingLost,
    RepeatWanted,
    ReplyReceived,
    UnexpectedReply,
)
from protocols.cb.frames import ChecksumFailed, FramingBroken, GarbageSkipped
from tests.mock_robot.bench import AWAY, HOME, Bench, bare_controller, joints_now, move_to

STATUS = cb.GetStatus()


def broken(fault: str, *, serial: bool = False, **how: int) -> Bench:
    """A greeted bench with that fault on."""
    bench = Bench(serial=serial).is_greeted()
    bench.faults.switch_on(fault, bench.controller, bench.now_s, **how)  # type: ignore[arg-type]
    return bench


def steps_of(bench: Bench, request: cb.Request = STATUS) -> list[object]:
    return list(bench.link.receive_data(bench.client.request(request), bench.now_s))


def test_every_fault_has_a_place_to_strike_and_a_sentence() -> None:
    for name, fault in FAULTS.items():
        assert name.split("-")[0] == fault.area
        assert fault.area in ("rws", "egm") or any((fault.begin, fault.reply, fault.send, fault.receive)), name
        assert fault.summary
    assert len(FAULTS) >= 30


def test_delay_pauses_before_every_reply_and_stall_once() -> None:
    bench = broken("link-delay")
    for _ in range(2):
        pause, sent = steps_of(bench)
        assert isinstance(pause, Pause)
        assert isinstance(sent, Send)
        bench.client.abandon()
    assert [type(step) for step in steps_of(broken("link-stall"))] == [Pause, Send]


def test_split_sends_byte_by_byte_and_the_client_understands() -> None:
    bench = broken("link-split")
    assert isinstance(bench.asks(STATUS), cb.Report)
    bench = broken("link-split")
    assert all(len(step.data) == 1 for step in steps_of(bench) if isinstance(step, Send))


def test_links_that_break() -> None:
    assert [type(step) for step in steps_of(broken("link-drop-mid-frame"))] == [Send, Close]
    assert steps_of(broken("link-close")) == [Close()]
    assert steps_of(broken("link-reset")) == [Reset()]


def test_half_open_hears_nothing_until_it_is_mended_and_the_heartbeat_strikes() -> None:
    bench = Bench().is_armed()
    bench.asks(move_to(AWAY, 50.0))
    bench.faults.switch_on("link-half-open", bench.controller, bench.now_s)
    for _ in range(5):
        assert bench.sends(bench.client.request(cb.Ping())) == []
        bench.client.abandon()
        bench.passes(0.5)
    assert not bench.controller.armed
    assert not bench.controller.flags(bench.now_s) & Flag.MOVING
    bench.faults.clear(bench.controller, bench.now_s)
    assert bench.asks(cb.Ping()) == cb.Pong()


def test_a_lost_reply_leaves_the_request_done_and_a_repeat_is_answered() -> None:
    bench = Bench().is_armed()
    bench.faults.switch_on("link-reply-lost", bench.controller, bench.now_s, only=Command.MOVE)
    assert isinstance(bench.asks(STATUS), cb.Report), "other replies are not lost"
    assert bench.sends(bench.client.request(move_to(AWAY))) == []
    assert bench.controller.moves_accepted == 1
    [answered] = bench.sends(bench.client.repeat())
    assert isinstance(answered, ReplyReceived)
    assert answered.reply == cb.MoveAccepted()
    assert bench.controller.moves_accepted == 1


@pytest.mark.parametrize("serial", [False, True])
def test_a_flipped_bit_is_noticed(serial: bool) -> None:
    heard = broken("link-bit-flip", serial=serial).sends(Bench().is_greeted().client.request(STATUS))
    noticed = (ChecksumFailed, GarbledReply, FramingBroken, GarbageSkipped, UnexpectedReply)
    assert not heard or isinstance(heard[0], noticed)


def test_a_request_with_a_flipped_bit_is_not_done_and_closes_tcp() -> None:
    for seed in range(40):
        bench = Bench().is_armed()
        bench.faults._random.seed(seed)
        bench.faults.switch_on("link-request-bit-flip", bench.controller, bench.now_s)
        heard = bench.sends(bench.client.request(move_to(AWAY)))
        bench.passes(1.0)
        assert bench.controller.moves_accepted == 0
        assert bench.closed or any(isinstance(event, RepeatWanted) for event in heard)


def test_duplicates_in_both_directions_move_once() -> None:
    for fault in ("link-duplicate", "link-request-duplicate"):
        bench = Bench().is_armed()
        bench.faults.switch_on(fault, bench.controller, bench.now_s)
        heard = bench.sends(bench.client.request(move_to(AWAY)))
        assert isinstance(heard[0], ReplyReceived)
        assert not any(isinstance(event, ReplyReceived) for event in heard[1:])
        assert bench.controller.arm.departures == 1


@pytest.mark.parametrize("fault", ["link-garbage", "serial-noise", "serial-magic-in-noise"])
def test_dirt_before_a_frame_breaks_tcp_and_is_skipped_on_a_serial_line(fault: str) -> None:
    bench = broken(fault, serial=True)
    heard = bench.sends(bench.client.request(STATUS))
    heard += bench.client.abandon_half_frame()
    assert any(isinstance(event, GarbageSkipped | ChecksumFailed) for event in heard)
    assert any(isinstance(event, ReplyReceived) for event in heard)
    bench = broken(fault)
    assert any(isinstance(event, FramingBroken) for event in bench.sends(bench.client.request(STATUS)))


@pytest.mark.parametrize("fault", ["serial-half-frame", "serial-doubled-byte", "serial-break"])
def test_a_spoilt_reply_on_a_serial_line_is_repeated_and_then_understood(fault: str) -> None:
    for seed in range(30):
        bench = Bench(serial=True).is_armed()
        bench.faults._random.seed(seed)
        bench.faults.switch_on(fault, bench.controller, bench.now_s)
        heard = bench.sends(bench.client.request(move_to(AWAY)))
        heard += bench.client.abandon_half_frame()
        if not any(isinstance(event, ReplyReceived) for event in heard):
            heard = bench.sends(bench.client.repeat()) + bench.client.abandon_half_frame()
        assert any(isinstance(event, ReplyReceived) for event in heard)
        assert bench.controller.arm.departures == 1


def test_a_restart_closes_tcp_and_asks_a_serial_client_to_greet_again() -> None:
    bench = Bench().is_armed()
    bench.faults.switch_on("link-restart", bench.controller, bench.now_s)
    bench.passes(0.1)
    assert bench.closed
    assert bench.controller.session == 78
    bench = Bench(serial=True).is_armed()
    bench.faults.switch_on("link-restart", bench.controller, bench.now_s)
    heard = bench.sends(bench.client.request(STATUS))
    assert any(isinstance(event, GreetingLost) for event in heard)
    assert bench.client.state is ClientSessionState.NOT_GREETED
    assert not bench.controller.armed


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
    bench = Bench().is_armed()
    bench.asks(move_to(AWAY, 50.0))
    seq = bench.client.last_seq
    bench.passes(0.5)
    bench.faults.switch_on(fault, bench.controller, bench.now_s)
    assert bench.finishes(seq) is status
    bench.faults.clear(bench.controller, bench.now_s, fault)
    standing = joints_now(bench)
    bench.passes(1.0)
    np.testing.assert_array_equal(joints_now(bench), standing)
    refused = bench.asks(move_to(HOME))
    assert isinstance(refused, cb.Refused)


def test_an_arm_that_never_settles_never_finishes() -> None:
    bench = Bench(bare_controller(time_scale=50.0)).is_armed()
    bench.faults.switch_on("robot-not-settled", bench.controller, bench.now_s)
    bench.asks(move_to(AWAY))
    seq = bench.client.last_seq
    bench.passes(1.0)
    report = bench.report()
    assert report.finished_seq == 0
    assert not report.flags & Flag.IN_POSITION
    bench.faults.clear(bench.controller, bench.now_s)
    assert bench.finishes(seq) is Status.OK


def test_speed_override_zero_accepts_a_move_that_goes_nowhere() -> None:
    bench = Bench().is_armed()
    bench.faults.switch_on("robot-override-zero", bench.controller, bench.now_s)
    assert bench.asks(move_to(AWAY)) == cb.MoveAccepted()
    bench.passes(1.0)
    assert bench.report().flags & Flag.SPEED_LIMITED
    assert np.abs(joints_now(bench) - HOME).max() < 1e-3
    assert bench.report().progress_per_mille == 0


def test_poses_that_lie() -> None:
    honest = Bench().is_greeted().pose()

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
    bench = Bench(bare_controller(time_scale=100.0)).is_armed()
    bench.faults.switch_on("link-reply-lost", bench.controller, bench.now_s, strikes=2, after_moves=2)
    for goal in (AWAY, HOME):
        assert bench.asks(move_to(goal)) == cb.MoveAccepted()
        seq = bench.client.last_seq
        if goal is AWAY:
            assert bench.finishes(seq) is Status.OK
    for _ in range(2):
        assert bench.sends(bench.client.request(STATUS)) == []
        bench.client.abandon()
    assert isinstance(bench.asks(STATUS), cb.Report)
    assert not bench.faults.active


def test_an_unknown_fault_lists_the_known() -> None:
    bench = Bench()
    with pytest.raises(UnknownFault, match="serial-noise"):
        bench.faults.switch_on("nope", bench.controller, 0.0)
    with pytest.raises(UnknownFault):
        bench.faults.clear(bench.controller, 0.0, "nope")


LINE_FAULTS = sorted(name for name, fault in FAULTS.items() if fault.area in ("link", "serial"))


@pytest.mark.parametrize("serial", [False, True], ids=["tcp", "serial"])
def test_no_random_schedule_of_faults_moves_twice_for_one_request(serial: bool) -> None:
    """A client that repeats what was not answered: as many departures as distinct MOVE requests, at most."""
    departures = 0
    for seed in range(500):
        schedule = random.Random(seed)
        bench = Bench(bare_controller(time_scale=50.0), serial=serial).is_armed()
        bench.faults._random.seed(seed)
        requests = 0
        for _ in range(4):
            fault = schedule.choice(LINE_FAULTS)
            bench.faults.switch_on(fault, bench.controller, bench.now_s, after_moves=schedule.randrange(2))
            if bench.closed or bench.client.state is not ClientSessionState.GREETED:
                break
            bench.client.abandon()
            data = bench.client.request(move_to(schedule.choice([HOME, AWAY])))
            requests += 1
            for _ in range(schedule.randrange(1, 4)):
                bench.sends(data)
                bench.passes(0.3)
            bench.faults.clear(bench.controller, bench.now_s)
        assert bench.controller.arm.departures <= requests
        departures += bench.controller.arm.departures
    assert departures > 500, "the schedules must let the arm move, or they show nothing"


def test_faults_may_strike_what_another_has_swallowed() -> None:
    bench = broken("link-half-open")
    bench.faults.switch_on("link-request-bit-flip", bench.controller, bench.now_s)
    assert bench.faults.alter_incoming(b"anything") == b""
