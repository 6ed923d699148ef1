"""Faults of a CB link on a line in memory, with a clock that only the test advances."""

import asyncio
import contextlib
import itertools

import pytest

from calibration.kinematics.arm import Configuration
from drivers.errors import DeviceUnreachable, GarbledAnswer, LinkLost, MoveFailed, MoveStalled, RequestRefused
from drivers.interfaces import MoveGoal, Standstill
from drivers.robots.abb.cb_robot import CbRobot
from drivers.robots.abb.cb_session import REPLY_LIMIT_S
from protocols.cb.codes import Command, Status
from protocols.cb.frames import Frame
from protocols.cb.messages import GetPose, GetStatus, Hello, Ping, SetArmed, Stop
from tests.drivers.robots.fake_controller import BASE_T_FLANGE, FakeController
from tests.support.waiting import FakeTime, settle

GOAL = MoveGoal(BASE_T_FLANGE, Configuration(0, 0, 0, 0))


class MemoryLine:
    """A transport and its connection at once; `deaf` swallows what is sent, `slowly` delays each answer."""

    address = "memory"
    half_frame_limit_s = 0.2

    def __init__(self, controller, *, resynchronise=False):
        self.controller, self.resynchronise = controller, resynchronise
        self.deaf = self.refusing = False
        self.sent = []
        self.attempts = self.closed = 0
        self.slowly = None
        self.may_close = asyncio.Event()
        self.may_close.set()

    async def connect(self):
        self.attempts += 1
        if self.refusing:
            raise DeviceUnreachable("memory", "connection refused", "connect it")
        self._session = self.controller.new_session()
        self._arriving = asyncio.Queue()
        return self

    async def send(self, data):
        self.sent.append(data)
        if not self.deaf:
            for piece in self.controller.pieces(self._session, data):
                self._arriving.put_nowait(piece)

    async def receive(self):
        piece = await self._arriving.get()
        if self.slowly is not None:
            await self.slowly()
        return piece

    async def close(self):
        await self.may_close.wait()
        self.closed += 1


@contextlib.asynccontextmanager
async def on_a_memory_line(controller=None, limit_s=None):
    line, fake = MemoryLine(controller or FakeController()), FakeTime()
    robot = CbRobot(line, fake.timing, limit_s=limit_s)
    robot.start()
    await settle()
    yield robot, line, fake
    line.deaf = False
    closing = asyncio.create_task(robot.close())
    await fake.advance(5)
    await closing


async def test_two_seconds_without_a_reply_are_a_lost_link():
    async with on_a_memory_line() as (robot, line, fake):
        line.deaf = True
        reading = asyncio.create_task(robot.read_pose())
        await fake.advance(REPLY_LIMIT_S - 0.01)
        assert not reading.done()
        assert robot.link.connected
        await fake.advance(0.02)
        with pytest.raises(LinkLost, match="no reply for 2 s"):
            await reading
        assert not robot.link.connected
        asked = [data for data in line.sent if data[3] == Command.GET_POSE]
        assert len(asked) > 3
        assert len(set(asked)) == 1, "every repetition has the same number and bytes"


async def test_a_controller_that_is_only_slow_does_not_drown_in_repetitions():
    async with on_a_memory_line() as (robot, line, fake):
        line.slowly = lambda: fake.timing.sleep(0.4)
        reading = [asyncio.create_task(robot.read_pose()) for _ in range(10)]
        await fake.advance(12)
        assert all(read.done() for read in reading)
        assert [read.exception() for read in reading] == [None] * 10


async def test_silence_is_noticed_without_anybody_asking():
    async with on_a_memory_line() as (robot, line, fake):
        line.deaf = True
        await fake.advance(0.5 + REPLY_LIMIT_S + 0.01)
        assert not robot.link.connected
        assert "no reply for 2 s" in robot.link.detail


async def test_a_ping_every_half_second_when_nobody_asks():
    async with on_a_memory_line() as (_, line, fake):
        await fake.advance(5.01)
        assert line.controller.arm.count(Ping) == 10


async def test_no_ping_while_others_ask():
    async with on_a_memory_line() as (robot, line, fake):
        for _ in range(20):
            await robot.read_pose()
            await fake.advance(0.25)
        assert line.controller.arm.count(Ping) == 0


async def test_it_dials_again_after_half_one_two_and_then_every_five_seconds():
    async with on_a_memory_line() as (robot, line, fake):
        line.refusing = line.deaf = True
        await fake.advance(0.5 + REPLY_LIMIT_S)
        attempts = []
        for _ in range(1950):
            await fake.advance(0.01)
            attempts.append(line.attempts)
        rises = [k for k in range(1, len(attempts)) if attempts[k] > attempts[k - 1]]
        waits_s = [(b - a) * 0.01 for a, b in itertools.pairwise(rises)]
        assert waits_s[:4] == pytest.approx([1, 2, 5, 5], abs=0.021)
        line.refusing = line.deaf = False
        await fake.advance(5)
        assert robot.link.connected
        assert robot.link.since_s == pytest.approx(fake.now_s, abs=5)


async def test_the_link_is_disarmed_and_numbers_go_on_after_a_reconnect():
    async with on_a_memory_line() as (robot, line, fake):
        await robot.set_armed(True)
        line.deaf = True
        await fake.advance(2.6)
        line.deaf = False
        await fake.advance(1)
        assert robot.link.connected
        assert not (await robot.read_status()).armed
        numbers = [int.from_bytes(data[4:6], "little") for data in line.sent]
        assert numbers == sorted(numbers), "no number is used again"
        assert line.controller.arm.count(Hello) == 2


async def test_a_move_over_a_dying_link_is_lost_and_never_asked_again():
    controller = FakeController()
    controller.arm.polls_per_move = None
    async with on_a_memory_line(controller) as (robot, line, fake):
        await robot.set_armed(True)
        moving = asyncio.create_task(robot.move_to(GOAL))
        await fake.advance(0.5)
        line.deaf = True
        await fake.advance(2.6)
        with pytest.raises(LinkLost):
            await moving
        line.deaf = False
        await fake.advance(20)
        assert robot.link.connected
        assert len(controller.arm.moves) == 1


async def test_an_arm_that_stands_on_its_way_is_stopped_with_the_reason():
    controller = FakeController()
    controller.arm.polls_per_move, controller.arm.advances = None, False
    async with on_a_memory_line(controller) as (robot, _, fake):
        await robot.set_armed(True)
        moving = asyncio.create_task(robot.move_to(GOAL))
        await fake.advance(4.5)
        assert not moving.done()
        await fake.advance(1.5)
        with pytest.raises(MoveStalled, match="stood still for 5 s after 50 % of the way"):
            await moving
        assert controller.arm.count(Stop) == 1
        assert robot.link.connected


async def test_a_controller_that_forgot_the_move_does_not_hold_it_for_ever():
    controller = FakeController()
    controller.arm.polls_per_move = None
    async with on_a_memory_line(controller) as (robot, _, fake):
        await robot.set_armed(True)
        moving = asyncio.create_task(robot.move_to(GOAL))
        await fake.advance(10)
        assert not moving.done(), "a long move is a long move"
        controller.arm.running_seq = 0
        await fake.advance(3)
        with pytest.raises(MoveFailed, match="does not know move"):
            await moving


async def test_an_error_under_way_stops_the_arm():
    controller = FakeController()
    controller.arm.polls_per_move = None
    async with on_a_memory_line(controller) as (robot, _, fake):
        await robot.set_armed(True)
        moving = asyncio.create_task(robot.move_to(GOAL))
        await fake.advance(0.2)
        controller.mangle = lambda request, reply: (
            [Frame(0x86, int.from_bytes(reply[4:6], "little")).encode()] if isinstance(request, GetStatus) else [reply]
        )
        await fake.advance(0.2)
        with pytest.raises(GarbledAnswer):
            await moving
        assert controller.arm.count(Stop) == 1


async def test_a_stop_does_not_wait_behind_a_question_without_an_answer():
    controller = FakeController()
    async with on_a_memory_line(controller) as (robot, _, fake):
        controller.mangle = lambda request, reply: [] if isinstance(request, GetPose) else [reply]
        reading = asyncio.create_task(robot.read_pose())
        also_waiting = asyncio.create_task(robot.read_status())
        await settle()
        await robot.stop_and_disarm()
        assert [type(request) for request in controller.arm.heard[-3:]] == [GetPose, Stop, SetArmed]
        controller.mangle = lambda request, reply: [reply]
        await fake.advance(0.5)
        await asyncio.gather(reading, also_waiting)


async def test_stop_disarm_and_their_confirmation_go_before_a_thousand_readers():
    controller = FakeController()
    async with on_a_memory_line(controller) as (robot, _, _fake):
        await robot.set_armed(True)
        controller.mangle = lambda request, reply: [] if isinstance(request, GetPose) else [reply]
        readers = [asyncio.create_task(robot.read_pose()) for _ in range(1000)]
        await settle()
        confirmed = asyncio.gather(robot.stop_and_disarm(), robot.read_standstill())
        assert (await confirmed)[1] == Standstill(standing=True, disarmed=True)
        heard = [type(request) for request in controller.arm.heard]
        stopped = heard.index(Stop)
        assert heard[stopped - 1 : stopped + 3] == [GetPose, Stop, SetArmed, GetStatus]
        for reader in readers:
            reader.cancel()


async def test_a_move_cancelled_at_a_frozen_controller_waits_half_a_second_and_its_stop_goes_on():
    controller = FakeController()
    controller.arm.polls_per_move = None
    async with on_a_memory_line(controller, limit_s=20.0) as (robot, line, fake):
        await robot.set_armed(True)
        moving = asyncio.create_task(robot.move_to(GOAL))
        await fake.advance(0.1)
        line.deaf = True
        await fake.advance(0.1)
        moving.cancel()
        await fake.advance(0.49)
        assert not moving.done()
        await fake.advance(0.02)
        assert moving.cancelled()
        line.deaf = False
        await fake.advance(1.0)
        assert controller.arm.count(Stop) == 1


async def test_a_reader_that_is_cancelled_leaves_the_queue():
    controller = FakeController()
    async with on_a_memory_line(controller) as (robot, _, fake):
        controller.mangle = lambda request, reply: [] if isinstance(request, GetPose) else [reply]
        readers = [asyncio.create_task(robot.read_pose()) for _ in range(1000)]
        await settle()
        for reader in readers[1:]:
            reader.cancel()
        await settle()
        controller.mangle = lambda request, reply: [reply]
        joints = asyncio.create_task(robot.read_joints())
        await fake.advance(0.5)
        await asyncio.gather(joints, readers[0])
        assert controller.arm.count(GetPose) == 1


async def test_an_arming_that_a_stop_overtakes_is_refused_and_not_repeated():
    controller = FakeController()
    async with on_a_memory_line(controller) as (robot, _, _fake):
        controller.mangle = lambda request, reply: [] if request == SetArmed(7, True) else [reply]
        arming = asyncio.create_task(robot.set_armed(True))
        await settle()
        await robot.stop_and_disarm()
        with pytest.raises(RequestRefused) as refused:
            await arming
        assert refused.value.status == "ABORTED"
        assert not controller.arm.armed


async def test_a_disarming_that_the_controller_refuses_is_an_error():
    controller = FakeController()
    async with on_a_memory_line(controller) as (robot, _, _fake):
        controller.arm.refuses[SetArmed] = Status.BAD_FIELD
        with pytest.raises(RequestRefused, match="disarming was refused"):
            await robot.stop_and_disarm()
        assert controller.arm.count(Stop) == 1


async def test_an_accepted_move_that_has_not_begun_is_no_standstill():
    controller = FakeController()
    async with on_a_memory_line(controller) as (robot, _, fake):
        controller.arm.polls_per_move = None
        await robot.set_armed(True)
        moving = asyncio.create_task(robot.move_to(GOAL))
        await settle()
        assert await robot.read_standstill() == Standstill(standing=False, disarmed=False)
        await robot.stop_and_disarm()
        assert await robot.read_standstill() == Standstill(standing=True, disarmed=True)
        await fake.advance(0.2)
        with pytest.raises(MoveFailed):
            await moving


async def test_closing_in_the_moment_of_a_loss_leaves_no_connection_open():
    async with on_a_memory_line() as (robot, line, fake):
        line.may_close.clear()
        line.deaf = True
        await fake.advance(0.5 + REPLY_LIMIT_S + 0.01)
        assert not robot.link.connected
        closing = asyncio.create_task(robot.close())
        await settle()
        assert not closing.done()
        line.may_close.set()
        await closing
        assert line.closed == 1


async def test_who_asks_while_the_link_is_closed_gets_a_lost_link():
    async with on_a_memory_line() as (robot, _, _fake):
        closing = asyncio.create_task(robot.close())
        await asyncio.sleep(0)
        asked = await asyncio.gather(*(robot.read_pose() for _ in range(3)), return_exceptions=True)
        await closing
        assert all(isinstance(error, LinkLost | DeviceUnreachable) for error in asked)
