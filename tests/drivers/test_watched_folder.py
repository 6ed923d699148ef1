"""Files with honest times, dishonest times, half written and in the way."""

import asyncio
import os
import re
import threading
import time

import pytest

from drivers.cameras.decoding import decode
from drivers.cameras.folder_camera import FolderCamera
from drivers.errors import AnswerTooLarge, DeviceError, DeviceTimeout, GarbledAnswer
from drivers.watched_folder import LAG_S
from tests.drivers.pictures import PNG
from tests.support.waiting import LIMIT_S, SkippableTime, eventually


@pytest.fixture
def clock():
    return SkippableTime()


@pytest.fixture
async def camera(tmp_path, clock):
    """It waits for a file as long as a test may take, or until the test skips that time."""
    camera = FolderCamera(tmp_path, clock.timing, limit_s=LIMIT_S)
    camera.start()
    yield camera
    await camera.close()


def leave(path, content=PNG, age_s=0.0):
    path.write_bytes(content)
    os.utime(path, (time.time() - age_s,) * 2)


async def error_when_the_time_is_over(camera, clock, newer_than_s, seen):
    """What a grab raises whose limit ends as soon as `seen()` holds."""
    grabbing = asyncio.create_task(camera.grab(newer_than_s))
    await asyncio.sleep(0)  # its limit runs from here
    await eventually(lambda: grabbing.done() or seen())
    clock.skip(2 * LIMIT_S)
    with pytest.raises(DeviceError) as failed:
        await grabbing
    return failed.value


async def test_a_file_is_as_old_as_its_time(tmp_path, camera, clock):
    leave(tmp_path / "a.png", age_s=3600)
    frame = await camera.grab(clock.clock() - 3700)
    assert clock.clock() - frame.taken_at_s >= 3600
    late = await error_when_the_time_is_over(camera, clock, clock.clock() - 10, lambda: True)
    assert isinstance(late, DeviceTimeout)
    assert re.search(r"a\.png, is 3[56].* s older than asked for", str(late))


async def test_a_time_in_the_future_makes_no_file_fresh(tmp_path, camera, clock):
    leave(tmp_path / "a.png", age_s=-3600)
    late = await error_when_the_time_is_over(camera, clock, clock.clock() - 10, lambda: camera.link.connected)
    assert isinstance(late, DeviceTimeout)


async def test_a_file_that_comes_with_a_future_time_is_as_old_as_its_first_sight(tmp_path, camera):
    await eventually(lambda: camera.link.connected)
    before_s = time.monotonic()
    leave(tmp_path / "a.png", age_s=-3600)
    frame = await camera.grab(before_s - 1)
    assert before_s - LAG_S <= frame.taken_at_s < time.monotonic()


async def test_a_half_written_file_is_waited_for(tmp_path, camera):
    leave(tmp_path / "a.png", PNG[:200])
    grabbing = asyncio.create_task(camera.grab(time.monotonic() - 600))
    await eventually(lambda: camera.link.detail == "the folder is there")
    leave(tmp_path / "a.png")
    assert (await grabbing).encoded == PNG


async def test_a_file_that_stays_half_is_reported_by_its_name(tmp_path, camera, clock, monkeypatch):
    leave(tmp_path / "a.png", PNG[:200])
    decoded = threading.Event()
    monkeypatch.setattr("drivers.cameras.folder_camera.decode", lambda *seen: (decoded.set(), decode(*seen))[1])
    error = await error_when_the_time_is_over(camera, clock, clock.clock() - 10, decoded.is_set)
    assert isinstance(error, GarbledAnswer)
    assert "a.png: not a whole picture: the PNG ends early" in str(error)


@pytest.mark.parametrize("name", ["a.png.tmp", ".a.png", "a.png~", "a.png.part", "a.txt", "a"])
async def test_temporary_and_other_names_do_not_count(name, tmp_path, camera, clock):
    leave(tmp_path / name)
    late = await error_when_the_time_is_over(camera, clock, clock.clock() - 10, lambda: camera.link.connected)
    assert isinstance(late, DeviceTimeout)
    assert "no file came" in str(late)


async def test_a_file_over_the_limit_is_not_even_read(tmp_path):
    leave(tmp_path / "a.png")
    camera = FolderCamera(tmp_path, limit_s=LIMIT_S, max_bytes=100)
    camera.start()
    with pytest.raises(AnswerTooLarge, match=f"has {len(PNG)} bytes, more than 100"):
        await camera.grab(time.monotonic() - 10)
    await camera.close()


async def test_the_newest_of_many_counts(tmp_path):
    for number in range(5):
        leave(tmp_path / f"{number}.png", PNG + bytes([number]), age_s=5 - number)
    camera = FolderCamera(tmp_path, limit_s=LIMIT_S)
    camera.start()
    assert (await camera.grab(time.monotonic() - 600)).encoded[-1] == 4
    await camera.close()
