"""Files with honest times, dishonest times, half written and in the way."""

import asyncio
import os
import re
import socket
import subprocess
import sys
import threading
import time

import pytest

from drivers.cameras.decoding import decode
from drivers.cameras.image_files import FolderCamera
from drivers.errors import AnswerTooLarge, DeviceError, DeviceTimeout, GarbledAnswer
from drivers.watched_folder import LAG_S, Sighting
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
    monkeypatch.setattr("drivers.cameras.image_files.decode", lambda *seen: (decoded.set(), decode(*seen))[1])
    error = await error_when_the_time_is_over(camera, clock, clock.clock() - 10, decoded.is_set)
    assert isinstance(error, GarbledAnswer)
    assert "a.png: not a whole picture: the PNG ends early" in str(error)


@pytest.mark.parametrize("name", ["a.png.tmp", ".a.png", "a.png~", "a.png.part", "a.txt", "a"])
async def test_temporary_and_other_names_do_not_count(name, tmp_path, camera, clock):
    leave(tmp_path / name)
    late = await error_when_the_time_is_over(camera, clock, clock.clock() - 10, lambda: camera.link.connected)
    assert isinstance(late, DeviceTimeout)
    assert "no file came" in str(late)


def in_the_way(kind, path, outside):
    """Something at `path` that is no regular file."""
    leave(outside)
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as server:
            server.bind(str(path))
    else:
        path.symlink_to({"link out of the folder": outside, "link to itself": path}.get(kind, kind))


IN_THE_WAY = [
    "pipe",
    "folder",
    "socket",
    "link out of the folder",
    "link to itself",
    "/dev/zero",
    "/dev/tty",
    "nowhere",
]


@pytest.mark.parametrize("kind", IN_THE_WAY)
async def test_what_is_no_file_is_not_opened_and_hides_no_picture(kind, tmp_path, camera, clock, tmp_path_factory):
    in_the_way(kind, tmp_path / "z.png", tmp_path_factory.mktemp("outside") / "a.png")
    late = await error_when_the_time_is_over(camera, clock, clock.clock() - 10, lambda: camera.link.connected)
    assert isinstance(late, DeviceTimeout)
    assert "no file came" in str(late)
    leave(tmp_path / "a.png")
    assert (await camera.grab(clock.clock() - 600)).encoded == PNG


@pytest.mark.parametrize("kind", IN_THE_WAY)
async def test_a_file_that_is_exchanged_before_it_is_read_is_not_opened(kind, tmp_path, tmp_path_factory, monkeypatch):
    path, outside = tmp_path / "a.png", tmp_path_factory.mktemp("outside") / "a.png"
    leave(path)
    camera = FolderCamera(tmp_path, limit_s=LIMIT_S)

    async def exchange(read, limit_s):
        path.unlink()
        in_the_way(kind, path, outside)
        return read()

    monkeypatch.setattr(camera._reader, "run", exchange)
    with pytest.raises(GarbledAnswer, match="it cannot be read"):
        await camera._read("camera", files_in_before(path))


def files_in_before(path):
    seen = path.stat()
    return Sighting(path, seen.st_size, seen.st_mtime_ns)


async def test_a_file_that_grows_is_read_up_to_the_limit(tmp_path):
    leave(tmp_path / "a.png")
    camera = FolderCamera(tmp_path, limit_s=LIMIT_S, max_bytes=len(PNG) - 1)
    with pytest.raises(AnswerTooLarge, match="more than"):
        await camera._read("camera", Sighting(tmp_path / "a.png", 1, 0))


HUNG_SHARE = """
import asyncio, signal, sys, threading
from pathlib import Path
import drivers.watched_folder as watched
from drivers.cameras.image_files import FolderCamera
from drivers.errors import DeviceUnreachable

watched.files_in = lambda *_: threading.Event().wait()
watched.POLL_LIMIT_S = 0.05

async def main():
    ended = asyncio.Event()
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, ended.set)
    camera = FolderCamera(Path(sys.argv[1]), limit_s=0.2)
    camera.start()
    for _ in range(3):
        try:
            await camera.grab(0.0)
        except DeviceUnreachable as error:
            threads = threading.active_count()
            print(error, threads, flush=True)
    await ended.wait()
    await camera.close()

asyncio.run(main())
"""


def test_a_share_that_hangs_is_reported_and_does_not_keep_the_process(tmp_path):
    with subprocess.Popen([sys.executable, "-c", HUNG_SHARE, tmp_path], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        said = [process.stdout.readline() for _ in range(3)]
        process.terminate()
        assert process.wait(LIMIT_S) == 0
    assert all("the folder was not listed in 0.05 s" in line and line.endswith(" 2\n") for line in said)


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
