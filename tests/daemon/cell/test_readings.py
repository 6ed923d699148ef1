"""Readers share the devices' readings, and a run goes before them."""

import asyncio
import traceback
from typing import Any

import numpy as np
import pytest

from daemon.api.schemas.cell import RobotDocument
from daemon.cell.cell import CameraTurns
from daemon.cell.readings import RobotReading
from daemon.runtime.clock import Clock
from daemon.runtime.shared_reading import MAX_AGE_S, MAX_RESUMED_A_TURN, RecentReading
from drivers.errors import DeviceTimeout
from drivers.interfaces import CameraFrame, LinkHealth
from tests.daemon.cell_under_test import Bench
from tests.support.waiting import FakeTime, settle

READERS = 1000


class Source:
    """Counts its readings; each waits until it is answered."""

    def __init__(self) -> None:
        self.begun = self.cancelled = 0
        self.answers: asyncio.Queue[int | Exception] = asyncio.Queue()

    async def read(self) -> int:
        self.begun += 1
        try:
            answer = await self.answers.get()
        except asyncio.CancelledError:
            self.cancelled += 1
            raise
        if isinstance(answer, Exception):
            raise answer
        return answer


@pytest.fixture
def source() -> Source:
    return Source()


@pytest.fixture
def time() -> FakeTime:
    return FakeTime()


@pytest.fixture
def shared(source: Source, time: FakeTime) -> RecentReading[int]:
    return RecentReading(source.read, lambda: time.now_s)


async def test_all_who_ask_share_one_reading(shared: RecentReading[int], source: Source) -> None:
    readers = [asyncio.create_task(shared.read()) for _ in range(READERS)]
    await settle()
    source.answers.put_nowait(7)
    assert set(await asyncio.gather(*readers)) == {7}
    assert await shared.read() == 7
    assert source.begun == 1


async def test_an_old_reading_is_not_given(shared: RecentReading[int], source: Source, time: FakeTime) -> None:
    source.answers.put_nowait(7)
    assert await shared.read() == 7
    time.now_s += MAX_AGE_S * 1.01
    source.answers.put_nowait(8)
    assert await shared.read() == 8


async def test_a_reading_is_given_to_the_next_when_all_who_waited_have_left(
    shared: RecentReading[int], source: Source
) -> None:
    for _ in range(READERS):
        reader = asyncio.create_task(shared.read())
        await asyncio.sleep(0)
        reader.cancel()
    await settle()
    assert (source.begun, source.cancelled) == (1, 0)
    source.answers.put_nowait(9)
    assert await shared.read() == 9
    assert source.begun == 1


async def test_an_error_is_for_those_who_waited(shared: RecentReading[int], source: Source) -> None:
    readers = [asyncio.create_task(shared.read()) for _ in range(3)]
    await settle()
    source.answers.put_nowait(DeviceTimeout("robot", "no answer", "look"))
    assert {type(error) for error in await asyncio.gather(*readers, return_exceptions=True)} == {DeviceTimeout}
    source.answers.put_nowait(7)
    assert await shared.read() == 7


async def test_those_who_waited_go_on_a_few_in_each_turn_in_their_order(
    shared: RecentReading[int], source: Source
) -> None:
    went_on: list[int] = []

    async def read(reader: int) -> None:
        await shared.read()
        went_on.append(reader)

    readers = [asyncio.create_task(read(reader)) for reader in range(5 * MAX_RESUMED_A_TURN)]
    await settle()
    source.answers.put_nowait(7)
    most = 0
    while len(went_on) < len(readers):
        before = len(went_on)
        await asyncio.sleep(0)
        most = max(most, len(went_on) - before)
    assert most == MAX_RESUMED_A_TURN
    assert went_on == list(range(len(readers)))


async def test_who_asks_as_a_reading_fails_gets_the_next_one(shared: RecentReading[int], source: Source) -> None:
    first = asyncio.create_task(shared.read())
    await settle()
    source.answers.put_nowait(DeviceTimeout("robot", "no answer", "look"))
    reading = shared._reading
    assert reading is not None
    while not reading.done():  # noqa: ASYNC110 - no turn of the loop may be missed
        await asyncio.sleep(0)
    second = asyncio.create_task(shared.read())
    await settle()
    assert isinstance(first.exception(), DeviceTimeout)
    assert not second.done()
    source.answers.put_nowait(7)
    assert await second == 7


async def test_the_traceback_of_an_error_does_not_grow_with_those_who_waited(
    shared: RecentReading[int], source: Source
) -> None:
    readers = [asyncio.create_task(shared.read()) for _ in range(READERS)]
    await settle()
    source.answers.put_nowait(DeviceTimeout("robot", "no answer", "look"))
    error = (await asyncio.gather(*readers, return_exceptions=True))[0]
    assert isinstance(error, DeviceTimeout)
    assert len(traceback.extract_tb(error.__traceback__)) < 10


class SlowCamera:
    """Gives a frame for each `release`; knows the grabs in progress, and those that were cancelled."""

    link = LinkHealth(True, "connected", 0.0)

    def __init__(self) -> None:
        self.grabs: list[float] = []
        self.cancelled: list[float] = []
        self.frames: asyncio.Queue[CameraFrame] = asyncio.Queue()

    def start(self) -> None: ...

    async def grab(self, newer_than_s: float) -> CameraFrame:
        self.grabs.append(newer_than_s)
        try:
            return await self.frames.get()
        except asyncio.CancelledError:
            self.cancelled.append(newer_than_s)
            raise

    async def close(self) -> None: ...


def a_frame() -> CameraFrame:
    return CameraFrame(np.zeros((2, 2), np.uint8), 0.0)


async def test_a_run_waits_for_one_reader_and_shares_its_frame_with_the_next() -> None:
    camera = SlowCamera()
    turns = CameraTurns(camera, Clock(monotonic_s=lambda: 5.0))
    first = asyncio.create_task(turns.read())
    await settle()
    run = asyncio.create_task(turns.grab(7.0))
    await settle()
    second = asyncio.create_task(turns.read())
    await settle()
    assert (camera.grabs, camera.cancelled) == ([5.0], [])
    for frame in (of_reader := a_frame(), of_run := a_frame()):
        camera.frames.put_nowait(frame)
    assert (await first, await run, await second) == (of_reader, of_run, of_run)
    assert camera.grabs == [5.0, 7.0]


async def test_a_reader_who_leaves_ends_its_grab() -> None:
    camera = SlowCamera()
    turns = CameraTurns(camera, Clock(monotonic_s=lambda: 5.0))
    reader = asyncio.create_task(turns.read())
    await settle()
    reader.cancel()
    await settle()
    assert camera.cancelled == [5.0]
    camera.frames.put_nowait(frame := a_frame())
    assert await turns.read() is frame


async def test_a_frame_of_a_run_is_not_given_to_those_who_ask_later() -> None:
    camera = SlowCamera()
    turns = CameraTurns(camera, Clock(monotonic_s=lambda: 5.0))
    for frame in (first := a_frame(), second := a_frame()):
        camera.frames.put_nowait(frame)
    assert await turns.grab(1.0) is first
    assert await turns.read() is second


@pytest.mark.parametrize("path", ["/robot", "/camera/frame.png", "/ready", "/calibrate"])
async def test_many_requests_cost_a_device_few_readings(bench: Bench, path: str) -> None:
    readings = bench.application.readings
    main = bench.application.cameras[0]
    for shared in (readings.robot, main.pictures.frame, main.obstacles):
        shared._monotonic_s = lambda: 0.0  # nothing becomes old
    await bench.application.cell.safe_stop.stop()  # it reads by itself
    before = bench.robot.requests + bench.camera.pictures
    answers = await asyncio.gather(*(bench.client.get(path) for _ in range(50)))
    assert {answer.status_code for answer in answers} == {200}
    assert bench.robot.requests + bench.camera.pictures - before <= 3


async def test_many_requests_for_the_robot_make_one_document(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.application.readings.robot._monotonic_s = lambda: 0.0  # nothing becomes old
    made: list[RobotReading] = []
    of = RobotDocument.of

    def count(reading: RobotReading, *known: Any) -> RobotDocument:
        made.append(reading)
        return of(reading, *known)

    monkeypatch.setattr(RobotDocument, "of", count)
    answers = await asyncio.gather(*(bench.client.get("/robot") for _ in range(50)))
    assert {answer.status_code for answer in answers} == {200}
    assert len(made) == 1


async def test_a_reader_does_not_receive_an_older_frame_when_the_runs_grab_fails() -> None:
    camera = SlowCamera()
    turns = CameraTurns(camera, Clock(monotonic_s=lambda: 5.0))
    camera.frames.put_nowait(a_frame())
    await turns.grab(1.0)
    run = asyncio.create_task(turns.grab(7.0))
    await settle()
    reader = asyncio.create_task(turns.read())
    await settle()
    run.cancel()
    await settle()
    camera.frames.put_nowait(new := a_frame())
    assert await reader is new
