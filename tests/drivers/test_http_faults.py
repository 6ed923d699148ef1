"""What a driver says when an HTTP device misbehaves."""

import asyncio
import gzip
import ssl
import threading
import time
import zlib

import httpx
import pytest

from drivers.cameras.image_files import HttpCamera
from drivers.errors import AnswerTooLarge, DeviceTimeout, DeviceUnreachable, GarbledAnswer
from drivers.http_source import HttpSource, age_s, tls_trust
from tests.drivers.http_devices import Answer, http_device
from tests.drivers.pictures import PNG
from tests.support.waiting import LIMIT_S, FakeTime, SkippableTime, eventually

BOMB = gzip.compress(gzip.compress(bytes(50_000_000)))
"""Some hundred bytes that unpack to 50 MB."""

LONG = "x" * 5000


def packed(content: bytes, encoding: str) -> Answer:
    return Answer(content, headers={"Content-Encoding": encoding})


def moved(to: str) -> Answer:
    return Answer(b"moved", status=302, headers={"Location": to})


FAULTS = {
    "empty body": (Answer(b""), GarbledAnswer, "the answer is empty"),
    "a page": (Answer(b"<html>", "text/html"), GarbledAnswer, "neither PNG nor JPEG"),
    "a stream": (
        Answer(b"--f", "multipart/x-mixed-replace; boundary=f"),
        GarbledAnswer,
        "write it as video:http://127",
    ),
    "half a picture": (Answer(PNG[:300]), GarbledAnswer, "ends early"),
    "cut off": (Answer(PNG[:300], announced=len(PNG)), GarbledAnswer, "no whole HTTP answer"),
    "not found": (Answer(b"no", status=404), GarbledAnswer, "404 Not Found"),
    "not allowed": (Answer(b"no", status=401), GarbledAnswer, "user and password"),
    "not ready": (Answer(b"no", status=503), DeviceUnreachable, "503"),
    "too large": (Answer(b"\0" * 5000), AnswerTooLarge, "more than 4096 bytes"),
    "age of letters": (Answer(PNG, headers={"X-Taken-At-Age-S": "new"}), GarbledAnswer, "an age that cannot be read"),
    "date of letters": (Answer(PNG, headers={"Last-Modified": "yesterday"}), GarbledAnswer, "an age that cannot"),
    "age that is no number": (Answer(PNG, headers={"X-Taken-At-Age-S": "nan"}), GarbledAnswer, "an age that cannot"),
    "age without end": (Answer(PNG, headers={"Age": "inf"}), GarbledAnswer, "an age that cannot be read"),
    "packed twice": (packed(BOMB, "gzip, gzip"), GarbledAnswer, r"packed \(Content-Encoding: gzip, gzip\)"),
    "packed": (packed(gzip.compress(PNG), "GZIP"), GarbledAnswer, "packed"),
    "deflated": (packed(zlib.compress(PNG), "deflate"), GarbledAnswer, "packed"),
    "packed in an unknown way": (packed(PNG, LONG), GarbledAnswer, r"packed \(Content-Encoding: x{80}\)"),
    "redirect to a file": (moved("file:///etc/passwd"), GarbledAnswer, "redirects to file:"),
    "redirect to another host": (moved("http://localhost:1/"), GarbledAnswer, "redirects to http://localhost:1/:"),
    "redirect to another port": (moved("http://127.0.0.1:1/a?b"), GarbledAnswer, "redirects to http://127.0.0.1:1/:"),
    "redirect to TLS elsewhere": (moved("https://127.0.0.1/"), GarbledAnswer, "redirects to https://127.0.0.1/:"),
    "redirect to itself": (moved("/now"), GarbledAnswer, "more than 5 redirects"),
    "redirect to nowhere": (moved("http://[::"), GarbledAnswer, "no whole HTTP answer"),
    "a page of a long kind": (Answer(b"<html>", LONG), GarbledAnswer, "neither PNG nor JPEG"),
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
        with pytest.raises(error, match=message) as raised:
            await grabbing
        assert len(str(raised.value)) < 400
        await camera.close()


async def test_a_redirect_at_the_same_server_is_followed_and_no_other_is_asked():
    with http_device(Answer(PNG)) as other, http_device(moved("/later")) as device:
        camera = HttpCamera(device.url, limit_s=LIMIT_S)
        device.answers["/later"] = Answer(PNG)
        assert (await camera.grab(0.0)).encoded == PNG
        device.answer = moved(other.url)
        with pytest.raises(GarbledAnswer, match="redirects to"):
            await camera.grab(0.0)
        assert other.asked == 0
        await camera.close()


async def test_a_device_that_hangs():
    with http_device(Answer(PNG, hangs=threading.Event())) as device:
        camera = HttpCamera(device.url, limit_s=0.2)
        with pytest.raises(DeviceTimeout, match=r"no answer in 0.2 s"):
            await camera.grab(0.0)
        assert not camera.link.connected
        await camera.close()


async def test_a_stream_that_never_ends_is_told_at_once_with_the_address_that_works():
    """Its first bytes say what it is: nothing of the body is waited for, and no password is shown."""

    async def stream(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readuntil(b"\r\n\r\n")
        writer.write(b"HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=f\r\n\r\n")
        await reader.read()  # until the camera hangs up
        writer.close()

    async with await asyncio.start_server(stream, "127.0.0.1", 0) as server:
        port = server.sockets[0].getsockname()[1]
        camera = HttpCamera(f"http://user:secret@127.0.0.1:{port}/mjpeg", limit_s=3600.0)
        with pytest.raises(GarbledAnswer, match=f"write it as video:http://127.0.0.1:{port}/mjpeg"):
            await asyncio.wait_for(camera.grab(0.0), LIMIT_S)
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
    camera = HttpCamera("http://user:secret@127.0.0.1:9/now?token=secret", limit_s=0.1)
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


@pytest.mark.parametrize(
    "url", ["https://camera:8443/now", "https://camera/now", "http://camera/now", "http://camera:80/now"]
)
def test_authorities_are_trusted_where_https_may_be_spoken(url: str) -> None:
    assert tls_trust(httpx.URL(url)) is True


def test_from_plain_http_at_a_port_of_its_own_nobody_is_trusted() -> None:
    trust = tls_trust(httpx.URL("http://camera:8080/now"))
    assert isinstance(trust, ssl.SSLContext)
    assert (trust.verify_mode, trust.check_hostname, trust.get_ca_certs()) == (ssl.CERT_REQUIRED, True, [])


async def test_a_device_whose_connection_takes_too_long_is_asked_again() -> None:
    """A busy machine accepts late: until the picture's own limit that is no reason to give up."""
    fake = FakeTime()
    asked: list[httpx.Request] = []

    def answer(request: httpx.Request) -> httpx.Response:
        asked.append(request)
        if len(asked) < 3:
            raise httpx.ConnectTimeout("", request=request)
        return httpx.Response(200, stream=httpx.ByteStream(PNG), headers={"Content-Type": "image/png"})

    source = HttpSource("http://camera/now", fake.timing, limit_s=60.0, max_bytes=4096)
    source._client = httpx.AsyncClient(transport=httpx.MockTransport(answer))
    fetching = asyncio.create_task(source.fetch(-1.0))
    while not fetching.done():
        await fake.advance(1.0)
    assert (await fetching).content == PNG
    assert len(asked) == 3
    await source.close()


async def test_smaller_pictures_are_asked_for_where_the_server_offers_them() -> None:
    """An address with a query of its own keeps it; who offers nothing is asked as ever."""
    asked: list[str] = []
    offers: dict[str, str] = {}

    def answer(request: httpx.Request) -> httpx.Response:
        asked.append(str(request.url))
        return httpx.Response(200, stream=httpx.ByteStream(PNG), headers={"Content-Type": "image/png", **offers})

    camera = HttpCamera("http://camera/now?channel=2")
    camera._client = httpx.AsyncClient(transport=httpx.MockTransport(answer))
    await camera.preview(-1.0, 960)
    offers["X-Scales-By"] = "width"
    for take in (camera.preview(-1.0, 960), camera.preview(-1.0, 960), camera.grab(-1.0)):
        await take
    plain = "http://camera/now?channel=2"
    assert asked == [plain, plain, f"{plain}&width=960", plain]
    await camera.close()
