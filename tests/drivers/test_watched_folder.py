"""Files with honest times, dishonest times, half written and in the way."""

import asyncio
import os
import time

import pytest

from drivers.cameras.folder_camera import FolderCamera
from drivers.errors import AnswerTooLarge, DeviceTimeout, GarbledAnswer
from tests.drivers.pictures import PNG
from tests.support.waiting import eventually


@pytest.fixture
async def camera(tmp_path):
    camera = FolderCamera(tmp_path, limit_s=0.5)
    camera.start()
    yield camera
    await camera.close()


def leave(path, content=PNG, age_s=0.0):
    path.write_bytes(content)
    os.utime(path, (time.time() - age_s,) * 2)


async def test_a_file_is_as_old_as_its_time(tmp_path):
    leave(tmp_path / "a.png", age_s=3600)
    camera = FolderCamera(tmp_path, limit_s=0.3)
    camera.start()
    assert 3600 <= time.monotonic() - (await camera.grab(time.monotonic() - 3700)).taken_at_s < 3601.5
    with pytest.raises(DeviceTimeout, match=r"a\.png, is 3[56].* s older than asked for"):
        await camera.grab(time.monotonic() - 10)
    await camera.close()


async def test_a_time_in_the_future_makes_no_file_fresh(tmp_path):
    leave(tmp_path / "a.png", age_s=-3600)
    camera = FolderCamera(tmp_path, limit_s=0.3)
    camera.start()
    with pytest.raises(DeviceTimeout):
        await camera.grab(time.monotonic() - 10)
    await camera.close()


async def test_a_file_that_comes_with_a_future_time_is_as_old_as_its_first_sight(tmp_path, camera):
    await eventually(lambda: camera.link.connected)
    before_s = time.monotonic()
    leave(tmp_path / "a.png", age_s=-3600)
    frame = await camera.grab(before_s - 1)
    assert before_s - 0.25 < frame.taken_at_s < time.monotonic()


async def test_a_half_written_file_is_waited_for(tmp_path, camera):
    leave(tmp_path / "a.png", PNG[:200])
    grabbing = asyncio.create_task(camera.grab(time.monotonic() - 10))
    await eventually(lambda: camera.link.detail == "the folder is there")
    leave(tmp_path / "a.png")
    assert (await grabbing).encoded == PNG


async def test_a_file_that_stays_half_is_told_by_its_name(tmp_path, camera):
    leave(tmp_path / "a.png", PNG[:200])
    with pytest.raises(GarbledAnswer, match=r"a\.png: not a whole picture: the PNG ends early"):
        await camera.grab(time.monotonic() - 10)


@pytest.mark.parametrize("name", ["a.png.tmp", ".a.png", "a.png~", "a.png.part", "a.txt", "a"])
async def test_temporary_and_other_names_do_not_count(name, tmp_path, camera):
    leave(tmp_path / name)
    with pytest.raises(DeviceTimeout, match="no file came"):
        await camera.grab(time.monotonic() - 10)


async def test_a_file_over_the_limit_is_not_even_read(tmp_path):
    leave(tmp_path / "a.png")
    camera = FolderCamera(tmp_path, max_bytes=100)
    camera.start()
    with pytest.raises(AnswerTooLarge, match=f"has {len(PNG)} bytes, more than 100"):
        await camera.grab(time.monotonic() - 10)
    await camera.close()


async def test_the_newest_of_many_counts(tmp_path, camera):
    for number in range(5):
        leave(tmp_path / f"{number}.png", PNG + bytes([number]), age_s=5 - number)
    assert (await camera.grab(time.monotonic() - 10)).encoded[-1] == 4
