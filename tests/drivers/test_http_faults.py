"""What a driver says when an HTTP device misbehaves."""

import asyncio
import threading
import time

import httpx
import pytest

from drivers.cameras.http_camera import HttpCamera
from drivers.errors import AnswerTooLarge, DeviceTimeout, DeviceUnreachable, GarbledAnswer
from drivers.http_source import age_s
from tests.drivers.http_devices import Answer, http_device
from tests.drivers.pictures import PNG
from tests.support.waiting import LIMIT_S, SkippableTime, eventually

FAULTS = {
    "empty body": (Answer(b""), GarbledAnswer, "the answer is empty"),
    "a page": (Answer(b"<html>", "text/html"), GarbledAnswer, "neither PNG nor JPEG"),
    "half a picture": (Answer(PNG[:300]), GarbledAnswer, "ends early"),
    "cut off": (Answer(PNG[:300], announced=len(PNG)), GarbledAnswer, "no whole HTTP answer"),
    "not found": (Answer(b"no", status=404), GarbledAnswer, "404 Not Found"),
    "not allowed": (Answer(b"no", status=401), GarbledAnswer, "user and password"),
    "not ready": (Answer(b"no", status=503), DeviceUnreachable, "503"),
    "too large": (Answer(b"\0" * 5000), AnswerTooLarge, "more than 4096 bytes"),
    "age of letters": (Answer(PNG, headers={"X-Taken-At-Age-S": "new"}), GarbledAnswer, "an age that cannot be read"),
    "date of letters": (Answer(PNG, headers={"Last-Modified": "yesterday"}), GarbledAnswer, "an age that cannot"),
    "old": (Answer(PNG, headers={"Age": "60"}), DeviceTimeout, "older than asked for"),
}


@pytest.mark.parametrize(("answer", "error", "message"), FAULTS.values(), ids=FAULTS.keys())
async def test_each_fault_has_its_error(answer, error, message):
    clock = SkippableTime()
    with http_device(answer) as device:
        camera = HttpCamera(device.url, clock.timing, limit_s=LIMIT_S, max_bytes=4096)
        grabbing = asyncio.create_task(camera.grab(clock.clock() - 30))
        await eventually(lambda: grabbing.done() or device.asked > 1)
        clock.skip(2 * LIMIT_S)
        with pytest.raises(error, match=message):
            await grabbing
        await camera.close()


async def test_a_device_that_hangs():
    with http_device(Answer(PNG, hangs=threading.Event())) as device:
        camera = HttpCamera(device.url, limit_s=0.2)
        with pytest.raises(DeviceTimeout, match=r"no answer in 0.2 s"):
            await camera.grab(0.0)
        assert not camera.link.connected
        await camera.close()


async def test_it_is_asked_again_until_the_picture_is_fresh():
    with http_device(Answer(PNG, headers={"X-Taken-At-Age-S": "0.5"})) as device:
        camera = HttpCamera(device.url, limit_s=LIMIT_S)
        moment_s = time.monotonic()
        frame = await camera.grab(moment_s)
        assert frame.taken_at_s > moment_s
        assert device.asked > 2
        await camera.close()


async def test_a_password_in_the_url_is_used_and_not_shown():
    camera = HttpCamera("http://user:secret@127.0.0.1:9/now", limit_s=0.1)
    with pytest.raises(DeviceUnreachable) as unreachable:
        await camera.grab(0.0)
    assert "secret" not in str(unreachable.value)
    assert "secret" not in camera.link.detail
    await camera.close()


async def test_a_link_is_known_before_anybody_asks():
    with http_device(Answer(PNG)) as device:
        camera = HttpCamera(device.url)
        camera.start()
        await eventually(lambda: camera.link.connected)
        await camera.close()


@pytest.mark.parametrize(
    ("headers", "expected_s"),
    [
        ({}, 0.0),
        ({"X-Taken-At-Age-S": "0.25", "Age": "9"}, 0.25),
        ({"X-Taken-At-Age-S": "-3"}, 0.0),
        ({"Age": "0"}, 1.0),
        ({"Date": "Sat, 21 Nov 2026 04:00:10 GMT", "Last-Modified": "Sat, 21 Nov 2026 04:00:07 GMT"}, 4.0),
        ({"Last-Modified": "Sat, 21 Nov 2026 04:00:07 GMT"}, 0.0),
    ],
    ids=["nothing", "exact", "future", "whole seconds", "dates", "no date to compare"],
)
def test_an_age_is_what_the_headers_allow_at_most(headers, expected_s):
    assert age_s(httpx.Headers(headers)) == expected_s
